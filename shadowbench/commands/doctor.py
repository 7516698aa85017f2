"""`doctor`: check that everything needed to measure is installed."""

from shadowbench.commands import console, options


@options.command()
def doctor(json: options.Json = False, quiet: options.Quiet = False) -> int:
    """Check that shadowbench can run here.

    Prints the machine, library versions, the OpenGL renderer and its limits, the timer in use and its noise, how many
    rays Embree traces at once, and the cache of ray-traced truths. Exit code 3 if nothing can be drawn.
    """
    from shadowbench.measure.machine import diagnosis
    from shadowbench.versions import ABSENT

    found = diagnosis()
    missing = "missing" in found["opengl"]
    if json:
        console.print_json(found)
    else:
        for title, values in found.items():
            console.out().print(title.replace("_", " "))
            for name, value in values.items():
                console.print_line(f"  {name.replace('_', ' ')}: {value}")
        if missing:
            traced = found["versions"]["embreex"] != ABSENT
            works = "`truth`, `needs` and `score`" if traced else "`list`, `check`, `merge` and `report`"
            console.out().print(f"no technique can be drawn here; {works} work")
        elif "problem" in found["truth_cache"]:
            console.out().print("ready, but each command must trace its truths again: the cache cannot be used")
        elif not quiet:
            console.out().print("ready")
    return 3 if missing else 0
