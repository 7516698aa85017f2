"""The contract of techniques, what a plug-in needs: base class, parameters, specs, stage and registry."""
