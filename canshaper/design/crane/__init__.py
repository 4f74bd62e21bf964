"""The crane and its hanging grapple in CasADi: paper Eq. 1-12, derived instead of typed in.

For tools on a desk (tuning, studies, the judge of the simulator); needs the extra ``tools``. The
daemon never imports it.
"""
