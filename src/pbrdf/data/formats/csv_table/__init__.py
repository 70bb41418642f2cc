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
``quantity``        brdf, reflectance_factor, radiance, dn,           taken from a column called ``brdf``,
                    normalised                                        ``f_r``, ``reflectance_factor``,
                                                                      ``radiance`` or ``dn``, normalised where
                                                                      there are only ratios, else an error
``azimuth``         forward=0 or forward=180                          forward=0 assumed
``stokes``          p-s or s-p                                        p-s assumed
``illumination``    natural, or four numbers ``1,0,0,0``              natural
``cosine_weighted`` yes: values are multiplied by cos θ_r; or no      no
``angles``          degrees or radians                                degrees
``simulated``       0 or 1                                            0
=================== ================================================= ====================================

``title``, ``source``, ``reference``, ``instrument`` and any other key become attributes. What was assumed
about polarisation and azimuth is recorded in the attribute ``assumptions``.

**Columns.** ``theta_i``, ``theta_r``, ``phi``, ``wavelength``, ``group``, ``I``, ``Q``, ``U``, ``V``,
``dolp``, ``aolp``, ``m00`` … ``m33``, ratios such as ``Q/I`` or ``M12/M11``
(:mod:`pbrdf.data.formats.csv_table.ratios`), ``<name>_std``, and the covariances ``cov_IQ``, ``cov_IU``,
``cov_IV``, ``cov_QU``, ``cov_QV``, ``cov_UV``; case, spaces, hyphens and underscores do not matter, and some
usual synonyms are understood (``incidence``, ``zenith_i``, ``lambda``, ``s0`` … ``s3``).
A unit in the name, ``_deg``, ``_rad``, ``_nm``, ``_um`` or ``[deg]``, counts before the header's. Other
columns are left out and listed in the attribute ``ignored_columns``. Empty cells, ``nan`` and ``NA`` are
NaN. :mod:`pbrdf.files.delimited` says how columns may be separated, where the names may stand, and that sheets of
workbooks are read, too.

**Covariances.** Where there is any column of them, the variances are the squares of ``<name>_std``, or, where
there is one, the column ``cov_II``, ``cov_QQ``, ``cov_UU`` or ``cov_VV``; such a column also serves in place of
``<name>_std``.

**No azimuth column** means a measurement in the plane of incidence. Then ``theta_i`` must not be negative,
``theta_r`` ≥ 0 is on the side of the specular direction (φ = 0), and ``theta_r`` < 0 on the side of the
source (φ = π at |theta_r|). With an azimuth column a negative ``theta_r`` means |theta_r| at φ + π.
"""
