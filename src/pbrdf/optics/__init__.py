"""Physics formulas over generic Dr.Jit floats, one family a file.

Everything below works on any Dr.Jit floating-point type (float32 or float64, LLVM or CUDA, with or without
derivatives), and knows nothing of NumPy but for the last five. Vectors are plain tuples of three floats, so that the
same function is traced into a fit, an evaluation or a renderer's kernel.

====================  =====================================================================
``geometry``          directions, half vector, scattering angle: paper eq. (10)
``reference_planes``  rotation between the facet's and the surface's (p, s) frames: eq. (5)
``facet_reflection``  reflection by the mirror facets, whatever their density: eq. (2)
``fresnel``           reflection and transmission at a facet: eqs (6)-(8)
``facets``            slope statistics of the facets: eq. (3)
``shadowing``         shadowing and masking: eq. (4) and its alternatives
``diffuse``           modified Rahman-Pinty-Verstraete shape: eqs (9)-(10)
``quadrature``        averages over the lit and seen facets
``transport``         their nodes for rendering
``powers``            powers, fast in single precision
``transmission``      body light leaving (and entering) through the facets: eqs (12)-(13)
``stokes``            degree and angle of polarisation, of arrays of any kind
``mueller``           physical realisability of Mueller matrices
``elements``          polarisers and retarders, in the frame of an instrument
``half_difference``   half and difference angles, tilt of the mirror facet
``angles``            angles brought into their range
====================  =====================================================================
"""
