"""Small whole files of formats that are read but not written, as their writers make them, to be damaged."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["READER_SEEDS", "write_tables", "write_workbook", "write_workbook_parts"]

Maker = Callable[[Path], Any]

_ZEMAX = """# made
Source  Measured
Symmetry  PlaneSymmetrical
SpectralContent  Monochrome
ScatterType  BRDF
SampleRotation  1
0
AngleOfIncidence  2
20\t50
ScatterAzimuth 3
0 90 180
ScatterRadial 2
0 30

Monochrome
DataBegin
TIS 0.3
1.5 0.1
1.5 0.2
1.5 0.3
TIS 0.3
2.5 0.4
2.5 0.5
2.5 0.6
DataEnd
"""
_FRED = """type bsdf_data
format angles=deg bsdf=value scale=1
10 0
0\t0\t0.031
-10 0 0.036
30 90 0.030
50 20
50 200 0.060
"""
_ALTA = """#DIM 3 1
#PARAM_IN  ISOTROPIC_TV_TL_DPHI
#PARAM_OUT INV_STERADIAN
0.2\t0.5\t3.141592653589793\t0.9
0.3\t0.5\t0\t0.4
"""
_ALTA_CARTESIAN = """#DIM 6 3
#VS 0
#PARAM_IN CARTESIAN
0.6 0 0.8 0 0 1 0.1 0.2 0.3
0 0.6 0.8 0.6 0 0.8 0.1 0.2 0.3
"""
_ASTM = """LAB_NAME Some lab
SYSTEM_NAME goniometer

SAMPLE_NAME "Blue paint"
MEAS_NAME BRDF
NUM_POINTS 2
VARS theta_i,phi_i,theta_s,phi_s,465nm,630nm

0.5,0.0,0.5,3.141592653589793,0.9,0.8
0.5,0.25,-0.3,0.25,0.3,0.2
"""
_LIGHTTOOLS = """# made
Symmetry Asymmetric
SpectralContent Monochrome
ScatterAzimuth 2
90 270
ScatterRadial 3
0 30 90
DataBegin
AOI 30
POI 0
Side Front
Wavelength 550
ScatterType BRDF
TIS 0.3
0.1 0.2 0.0
0.1 0.9 0.0
DataEnd
"""
_READINGS = """theta_i,theta_r,phi,I0,I45,I90,I135
40,10,15,1.3,0.8,0.7,1.2
40,20,15,1.4,2.4,2.6,1.6
"""
_READING_ROWS = """# analyzer_gain: 2.5
# analyzer_retardance: 90
# analyzer_dark: 0.01
theta_i,theta_r,phi,polarizer,retarder,reading,reading_std
40,10,15,0,0,0.65,0.01
40,10,15,45,0,0.45,0.01
40,10,15,90,0,0.35,0.01
40,10,15,0,45,0.55,0.01
40,10,15,0,-45,0.45,0.01
"""


def _speos_table(percent: str = "") -> str:
    rows = "".join(f"{theta}\t3.0\t2.0\t3.0\n" for theta in range(0, 91, 10))
    return f"{percent}10 3\n\t0\t180\t360\n{rows}"


_SPEOS = (
    "OPTIS - Anisotropic BSDF surface file v8.0\n0\nA paint\n23\nMeasurement description\n0\t1\t0\n1\t0\n1\n1\n"
    "0.0\t\n2\n15.0\t30.0\t\n15.0\t0\n\n2\n350 40\n850 40\n" + 2 * _speos_table()
)
_SPEOS_BRDF = (
    "OPTIS - brdf surface file v9.0\n0\nScattering surface\n0\n\n1\t0\n1\n1\t2\n10\n500 600\n"
    + _speos_table("10\n")
    + _speos_table("20\n")
)


def _text(content: str) -> Maker:
    return lambda path: path.write_text(content, encoding="utf-8")


def _scatmech(path: Path) -> None:
    names = [f"m{i}{j}" for i in range(1, 5) for j in range(1, 5) if (i, j) != (1, 1)]
    lines = ["lambda,thetai,phi,thetar,phir,f_r11," + ",".join(names)]
    lines += [f"0.55,-30,0,{t},0,0.1,{','.join(['0.01'] * 15)}" for t in (10, 20, 30)]
    path.write_text("\n".join(lines), encoding="utf-8")


def _cornell(path: Path) -> None:
    lines = ["# a paint", "2", "400 500"] + [f"0.5 3.1 {t} 0.0 0.1 0.2" for t in (0.1, 0.2, 0.3)]
    path.write_text("\n".join(lines), encoding="utf-8")


def _openmaterial(path: Path) -> None:
    rows = [[9.05e-07, 0.5, 0.5, 0.0, 0.3], [9.05e-07, 0.5, 0.0, None, 0.4], [1.55e-06, 0.2, 0.5, 1.5, 0.2]]
    table = {"wavelengths": [9.05e-07, 1.55e-06], "lookupTable": rows}
    metadata = {"name": "asphalt", "sources": "measurement"}
    path.write_text(json.dumps({"metadata": metadata, "brdf": table}, indent=1), encoding="utf-8")


def _woollam(path: Path) -> None:
    lines = ["Gold on glass", "VASEmethod[EllipsometerType=14, Isotropic]", "Original[gold.dat]", "nm"]
    matrix = np.diag([1.0, 1.0, -0.6, -0.6])
    matrix[0, 1] = matrix[1, 0] = -0.2
    matrix[2, 3], matrix[3, 2] = 0.77, -0.77
    for at in ("500\t50", "633\t70"):
        lines += [f"E\t{at}\t40\t100\t0.1\t0.1", f"dPolE\t{at}\t0.5\t0.1", f"mm11\t{at}\t0.8\t0.01"]
        for i, j in list(np.ndindex(4, 4))[1:]:
            lines.append(f"mm{i + 1}{j + 1}\t{at}\t{matrix[i, j]:g}\t0.002")
    path.write_text("\r\n".join(lines) + "\r\n", encoding="utf-8")


def _spectraray(path: Path) -> None:
    lines = ["; WAVELENGTH" + " 70.20000" * 16]
    for wavelength, (a, b, c) in {522.8: (0.626, -0.036, 0.777), 550.3: (0.392, 0.063, 0.916)}.items():
        lines.append(
            f"{wavelength} 1.0 {a} 0.02 0.03 {a} 0.99 0.12 0.13 0.20 0.21 {b} {c} 0.30 0.31 {-c} 0.33 "
        )
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _tables() -> dict[str, np.ndarray]:
    axes = {name: np.linspace(0.1, 1.5, 3)[None] for name in ("theta_h", "theta_d")}
    axes["phi_d"] = np.linspace(-3.1, 3.1, 5)[None]
    matrices = np.broadcast_to(np.eye(4), (5, 3, 3, 2, 4, 4)).copy()
    return {**axes, "wvls": np.array([[450.0, 550.0]]), "pbrdf_T_f": matrices}


def _mat5(content: Mapping[str, Any], **options: Any) -> Maker:
    def write(path: Path) -> None:
        import scipy.io

        scipy.io.savemat(path, dict(content), **options)

    return write


def _mat73(content: Mapping[str, Any]) -> Maker:
    """Version 7.3: HDF5 behind 512 bytes, its dimensions in reverse."""

    def write(path: Path) -> None:
        import h5py

        with h5py.File(path, "w", userblock_size=512) as file:
            for name, values in content.items():
                file[name] = np.atleast_2d(values).T
                file[name].attrs["MATLAB_class"] = np.bytes_("double")
        with path.open("r+b") as raw:
            raw.write(b"MATLAB 7.3 MAT-file")

    return write


def _pbsdf(path: Path) -> None:
    from pbrdf.data.formats.tensor_file import write_tensors

    tables = {name: values.astype(np.float32) for name, values in _tables().items()}
    matrices = tables.pop("pbrdf_T_f")
    write_tensors({**tables, "wvls": np.array([450, 550], dtype=np.uint16), "M": matrices}, path)


def _rgl(path: Path) -> None:
    from pbrdf.data.formats.tensor_file import write_tensors

    v, u = np.meshgrid(np.linspace(0, 1, 4), np.linspace(0, 1, 4), indexing="ij")
    lobe = np.exp(-4 * u**2) + 0.05
    fields = {
        "description": np.frombuffer(b"a made material", np.uint8),
        "phi_i": np.zeros(1),
        "theta_i": np.deg2rad([0.0, 60.0]),
        "ndf": lobe * (1 + 0.1 * u * np.cos(2 * np.pi * v)),
        "sigma": 0.3 + 0.5 * (1 - u),
        "vndf": np.stack([lobe, lobe])[None],
        "luminance": np.full((1, 2, 3, 3), 0.5),
        "spectra": np.full((1, 2, 2, 3, 3), 0.5),
        "jacobian": np.ones(1, np.uint8),
        "wavelengths": np.array([450.0, 550.0]),
    }
    write_tensors({k: a if a.dtype == np.uint8 else a.astype(np.float32) for k, a in fields.items()}, path)


def _merl(path: Path) -> None:
    from pbrdf.data.formats.merl import SHAPE, write_planes

    write_planes(np.full((3, *SHAPE), 0.1), path)


#: By the name of a reader that writes nothing: how its seeds' names go on after its own, and what writes each.
READER_SEEDS: dict[str, dict[str, Maker]] = {
    "scatmech": {".csv": _scatmech},
    "cornell": {".brdf": _cornell},
    "zemax": {".bsdf": _text(_ZEMAX)},
    "rgl": {".bsdf": _rgl},
    "pbsdf": {".pbsdf": _pbsdf},
    "spectraray": {".txt": _spectraray},
    "readings": {".csv": _text(_READINGS), "_rows.csv": _text(_READING_ROWS)},
    "merl": {".binary": _merl},
    "fred": {".txt": _text(_FRED)},
    "speos": {".anisotropicbsdf": _text(_SPEOS), ".brdf": _text(_SPEOS_BRDF)},
    "openmaterial": {".xompt": _openmaterial},
    "matlab": {
        ".mat": _mat5(_tables()),
        "_packed.mat": _mat5(_tables(), do_compression=True),
        "_73.mat": _mat73(_tables()),
    },
    "lighttools": {".bsdf": _text(_LIGHTTOOLS)},
    "woollam": {".dat": _woollam},
    "alta": {".alta": _text(_ALTA), "_cartesian.alta": _text(_ALTA_CARTESIAN)},
    "astm": {".astm": _text(_ASTM)},
}

_COLUMNS = {
    "theta_i": [30.0, 30.0, 30.0],
    "theta_r": [10.0, 20.0, 40.0],
    "phi": [0.0, 0.0, 180.0],
    "brdf": [0.1, 0.3, 0.5],
}
_LETTER = "urn:oasis:names:tc:opendocument:xmlns"
_MAIN = "http://schemas.openxmlformats.org"


def _xlsx_parts() -> dict[str, str]:
    def cell(place: str, value: Any) -> str:
        if isinstance(value, str):
            return f'<c r="{place}" t="inlineStr"><is><t>{value}</t></is></c>'
        return f'<c r="{place}"><v>{value!r}</v></c>'

    rows = "".join(
        f'<row r="{r}">{"".join(cell(f"{chr(65 + c)}{r}", value) for c, value in enumerate(row))}</row>'
        for r, row in enumerate([list(_COLUMNS), *zip(*_COLUMNS.values(), strict=True)], 1)
    )
    kind = "application/vnd.openxmlformats-officedocument.spreadsheetml"
    office, package = f"{_MAIN}/officeDocument/2006/relationships", f"{_MAIN}/package/2006"
    link = f'<Relationships xmlns="{package}/relationships"><Relationship Id="rId1" Type="{office}'
    return {
        "[Content_Types].xml": f'<Types xmlns="{package}/content-types"><Default Extension="rels" '
        'ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
        f'<Override PartName="/xl/workbook.xml" ContentType="{kind}.sheet.main+xml"/>'
        f'<Override PartName="/xl/worksheets/sheet1.xml" ContentType="{kind}.worksheet+xml"/></Types>',
        "_rels/.rels": f'{link}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
        "xl/workbook.xml": f'<workbook xmlns="{_MAIN}/spreadsheetml/2006/main" xmlns:r="{office}">'
        '<sheets><sheet name="Data" sheetId="1" r:id="rId1"/></sheets></workbook>',
        "xl/_rels/workbook.xml.rels": f'{link}/worksheet" Target="worksheets/sheet1.xml"/></Relationships>',
        "xl/worksheets/sheet1.xml": f'<worksheet xmlns="{_MAIN}/spreadsheetml/2006/main">'
        f"<sheetData>{rows}</sheetData></worksheet>",
    }


def _ods_parts() -> dict[str, str]:
    def cell(value: Any) -> str:
        if isinstance(value, str):
            return f'<table:table-cell office:value-type="string"><text:p>{value}</text:p></table:table-cell>'
        return f'<table:table-cell office:value-type="float" office:value="{value!r}"/>'

    rows = "".join(
        f"<table:table-row>{''.join(map(cell, row))}</table:table-row>"
        for row in [list(_COLUMNS), *zip(*_COLUMNS.values(), strict=True)]
    )
    return {
        "mimetype": "application/vnd.oasis.opendocument.spreadsheet",
        "META-INF/manifest.xml": f'<manifest:manifest xmlns:manifest="{_LETTER}:manifest:1.0"/>',
        "content.xml": f'<office:document-content xmlns:office="{_LETTER}:office:1.0" '
        f'xmlns:table="{_LETTER}:table:1.0" xmlns:text="{_LETTER}:text:1.0"><office:body><office:spreadsheet>'
        f'<table:table table:name="Data">{rows}</table:table></office:spreadsheet></office:body>'
        "</office:document-content>",
    }


_WORKBOOKS = {".xlsx": _xlsx_parts, ".ods": _ods_parts}


def write_workbook(path: Path) -> None:
    """A table as a sheet of ``.xlsx`` or ``.ods``."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, part in _WORKBOOKS[path.suffix]().items():
            archive.writestr(name, part)


def write_workbook_parts(folder: Path) -> None:
    """What is inside such a file, as a folder: of a damaged archive the checksums are wrong, and no part is read."""
    for name, part in _WORKBOOKS[folder.suffix]().items():
        place = folder / name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(part, encoding="utf-8")


def write_tables(folder: Path) -> None:
    """Tables of columns as MATLAB keeps them: ``table.mat``, ``table_73.mat`` and, over axes, ``grid.mat``."""
    _mat5(_COLUMNS)(folder / "table.mat")
    _mat73(_COLUMNS)(folder / "table_73.mat")
    axes = {"theta_i": [10.0, 20.0], "theta_r": [1.0, 2.0, 3.0], "phi": [0.0, 60.0, 120.0, 180.0]}
    _mat5({**axes, "brdf": np.ones((4, 2, 3))})(folder / "grid.mat")
