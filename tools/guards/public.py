"""What the public functions return, printed."""

import shadowbench as sb

truth = sb.truth("stairs", view_size=64)
print(sb.render("stairs", "shadow-map", view_size=64).visibility.sum(), truth.visibility.sum())
print(sb.score(truth.area, truth))
table = sb.run(["stairs"], ["shadow-map"], map_size=[128], view_size=64, rounds=0)
print(table.drop(columns=["key", "command"]).to_json(orient="records"))
print(sb.needs("stairs", view_size=64))
