"""The crane and its hanging grapple in CasADi: paper Eq. 1-12, derived instead of typed in.

For the study of the paper, and to judge the simulator and the identification; needs the extra
``tools``. Nothing of the package imports it.
"""
