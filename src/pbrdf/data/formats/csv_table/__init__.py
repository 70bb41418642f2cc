"""The documented CSV table, and the tables of strangers.

A file of the project's own looks like this::

    # quantity: brdf
    # azimuth: forward=0
    # stokes: p-s
    # illumination: natural
    # title: white paint, 476 nm
    theta_i_deg,theta_r_deg,phi_deg,wavelength_nm,group,I,I_std,dolp
    30,30,0,476,1,0.61,0.01,0.08

**Header.** Lines ``# key: value`` before the column names; other comment lines are skipped. Each key may
instead be given to :func:`pbrdf.data.formats.csv_table.reading.read_csv` as an option, which then counts.

=================== ================================================= ====================================
key                 values                                            if it is not stated
=================== ================================================= ====================================
``quantity``        brdf, reflectance_factor, radiance, dn,           taken from the name of the values
                    normalised                                        (``brdf``, ``f_r``, ``BRF`` …) or their
                                                                      unit (1/sr), normalised where there are
                                                                      only ratios, else an error
``azimuth``         forward=0 or forward=180                          forward=0 assumed
``stokes``          p-s or s-p                                        p-s assumed
``illumination``    natural, or four numbers ``1,0,0,0``              natural
``cosine_weighted`` yes: values are multiplied by cos θ_r; or no      no
``angles``          degrees or radians                                degrees
``coverage``        coverage factor of expanded uncertainties         taken from their names, else an error
``scale``           arbitrary or absolute                             absolute; arbitrary for radiance and dn
``simulated``       0 or 1                                            0
=================== ================================================= ====================================

``title``, ``source``, ``reference``, ``instrument`` and any other key become attributes. What was assumed
about polarisation and azimuth is recorded in the attribute ``assumptions``.

**Columns.** ``theta_i``, ``theta_r``, ``phi``, ``wavelength``, ``group``, ``I``, ``Q``, ``U``, ``V``,
``dolp``, ``aolp``, ``m00`` … ``m33``, ratios such as ``Q/I`` or ``M12/M11``
(:mod:`pbrdf.data.formats.csv_table.ratios`), ``<name>_std``, and the covariances ``cov_IQ``, ``cov_IU``,
``cov_IV``, ``cov_QU``, ``cov_QV``, ``cov_UV``; case, spaces, hyphens and underscores do not matter, and some
usual synonyms are understood (``incidence``, ``zenith_i``, ``lambda``, ``s0`` … ``s3``;
:mod:`pbrdf.data.formats.csv_table.names`). Other columns are left out and listed in the attribute
``ignored_columns``; those that look like an uncertainty, a second sample, a wavelength or an azimuth are named in
a warning with the option that uses them (:mod:`pbrdf.data.formats.csv_table.leftovers`). What each column was
taken for stands in the data set's origin (:mod:`pbrdf.data.origin`). Empty cells, ``nan`` and ``NA`` are NaN.
:mod:`pbrdf.files.delimited` says how columns may be separated, where the names may stand, and that sheets of
workbooks are read, too.

**Units** stand in the name of a column (``_deg``, ``(1/msr)``, ``[%]``, ``/ nm``), in a row of units, in a comment
(``# units: deg, deg, 1/sr``, ``# BRDF in 1/msr``, ``# angles in radians``) or in the option `unit`, which counts
before all. A unit that is not understood, or cannot be that of its column, is an error
(:mod:`pbrdf.data.formats.csv_table.units`, :mod:`pbrdf.data.formats.csv_table.hints`).

**Uncertainties.** ``I_err``, ``sigma_I``, ``u(I)``, ``dI`` … are standard ones. Expanded ones, ``U (k=2)``, are
divided by k, relative ones multiplied by the values, variances rooted. One without a name belongs to the values where
there is one channel only. ``u``, ``v``, ``U`` and ``V`` without a ``Q`` are not taken for Stokes parameters unless
``I`` is called so and ``stokes`` is stated.

**Wavelengths as columns**, ``390nm``, ``R_550`` or ``400`` beside angles, become rows
(:mod:`pbrdf.data.formats.csv_table.wide`).

**Mueller elements** are counted from 1 where none has an index 0.

**Covariances.** Where there is any column of them, the variances are the squares of ``<name>_std``, or, where
there is one, the column ``cov_II``, ``cov_QQ``, ``cov_UU`` or ``cov_VV``; such a column also serves in place of
``<name>_std``.

**Two azimuths**, ``phi_i`` of the source and ``phi_r`` of the viewer, make φ. Both directions point away from the
surface: forward is where they differ by half a turn; with ``azimuth: forward=0`` the source's is that of the
travelling light, and forward is where they are equal. An azimuth of the source that varies and is not used is an error.

**No azimuth column** means a measurement in the plane of incidence. ``theta_r`` ≥ 0 is on the side of the
specular direction (φ = 0), and ``theta_r`` < 0 on the side of the source (φ = π at |theta_r|); with ``azimuth:
forward=180`` it is the other way round. Where ``azimuth`` is stated, ``theta_i`` may have a sign too: forward is where
both have the same sign (forward=0), or opposite ones (forward=180); else it must not be negative. With an azimuth
column a negative ``theta_r`` means |theta_r| at φ + π.
"""
