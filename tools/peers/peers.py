"""Identification by truepose and its peers on the same simulated rows (docs/PEERS.md).

    peers.py simulate DIR            arms, rows to fit, rows to judge by, Cramer-Rao floor
    peers.py truepose DIR PROGRAM    fit all rows in DIR; so do pybotics and figaroh,
    peers.py pybotics DIR            each in its own environment
    peers.py figaroh DIR
    peers.py table DIR               the table, in Markdown

The forward model below makes the truth; no tool that is compared has a part in it. m and rad.
"""

import csv
import itertools
import json
import pathlib
import resource
import subprocess
import sys
from typing import NamedTuple

import numpy as np

SEEDS, JUDGED = 20, 1000
CHECKED = 30  # noisy rows more for truepose's own report, which no fit sees
ORIENTATION_SIGMA = 100e-6  # one standard deviation an axis
EVALUATIONS = 60  # of residuals and derivatives for pybotics; some fits creep on for hundreds
LENGTH, ANGLE = 0.3e-3, 1e-3  # deviations of the arm, one standard deviation
PLACED = 2e-3  # of base and tool, m and rad

# A six-joint arm of IRB 120 size, Craig's convention: alpha, a, theta, d. Axes 2 and 3 are parallel.
DRAWING = np.array(
    [
        [0.0, 0.0, 0.0, 0.290],
        [-np.pi / 2, 0.0, -np.pi / 2, 0.0],
        [0.0, 0.270, 0.0, 0.0],
        [-np.pi / 2, 0.070, 0.0, 0.302],
        [np.pi / 2, 0.0, 0.0, 0.0],
        [-np.pi / 2, 0.0, np.pi, 0.072],
    ]
)
TOOL = np.array([0.060, 0.0, 0.120])
LIMITS = np.deg2rad([[-165, 165], [-110, 110], [-110, 70], [-160, 160], [-120, 120], [-180, 180]])
JOINTS = len(DRAWING)
ARMS = {
    "any": "axes moved and turned in every direction",
    "mdh": "deviations of alpha, a, theta and d alone",
}
KINDS = {"position": 3, "pose": 6}  # equations a row
PYBOTICS = ["pybotics", "pybotics, component"]
FIGAROH = ["figaroh, structural", "figaroh, excitation"]
PRIORS = ["truepose, minimum-variance", "truepose, cross-validated", "figaroh, map", "figaroh, map_cv"]


class Study(NamedTuple):
    """An arm of ARMS, what is measured, rows to fit, noise of positions, who fits."""

    arm: str
    kind: str
    rows: int
    sigma: float
    ways: list[str]


STUDIES = {
    "position": Study("any", "position", 100, 30e-6, ["truepose"] + PYBOTICS + FIGAROH),
    "pose": Study("any", "pose", 100, 30e-6, ["truepose"] + FIGAROH),
    "position-mdh": Study("mdh", "position", 100, 30e-6, ["truepose"] + PYBOTICS + FIGAROH),
    "pose-mdh": Study("mdh", "pose", 100, 30e-6, ["truepose"] + FIGAROH),
    "few": Study("any", "position", 20, 500e-6, ["truepose"] + FIGAROH + PRIORS),
}


# --- forward model, all rows at once: matrices of shape (rows, 4, 4) or (4, 4)


def turned(axis, angle):
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    t = np.zeros(np.shape(angle) + (4, 4))
    t[..., range(4), range(4)] = 1.0
    t[..., i, i] = t[..., j, j] = np.cos(angle)
    t[..., i, j], t[..., j, i] = -np.sin(angle), np.sin(angle)
    return t


def shifted(x, y, z):
    t = np.eye(4)
    t[:3, 3] = x, y, z
    return t


def placed(x, y, z, rx, ry, rz):
    return shifted(x, y, z) @ turned(2, rz) @ turned(1, ry) @ turned(0, rx)


def link(alpha, a, theta, d):
    return turned(0, alpha) @ shifted(a, 0, 0) @ turned(2, theta) @ shifted(0, 0, d)


def tool_poses(base, links, tool, q):
    """`links`: where each joint's frame stands on the one before it, joint at zero."""
    t = np.broadcast_to(base, (len(q), 4, 4))
    for k, frame in enumerate(links):
        t = t @ frame @ turned(2, q[:, k])
    return t @ tool


def drawn():
    return np.eye(4), [link(*row) for row in DRAWING], shifted(*TOOL)


def moved(arm, twists):
    """The arm with every frame (base, joints, tool) displaced in itself, six numbers each."""
    base, links, tool = arm
    base, *links, tool = [t @ placed(*w) for t, w in zip([base, *links, tool], twists)]
    return base, links, tool


def true_arm(kind, random):
    base, links, tool = drawn()
    if kind == "mdh":
        deltas = random.normal(size=(JOINTS, 4)) * [ANGLE, LENGTH, ANGLE, LENGTH]
        links = [link(*row) for row in DRAWING + deltas]
        off = np.zeros((JOINTS, 6))
    else:
        off = random.normal(size=(JOINTS, 6)) * ([LENGTH] * 3 + [ANGLE] * 3)
    outer = random.normal(size=(2, 6)) * PLACED
    return moved((base, links, tool), [outer[0], *off, outer[1]])


def joints(random, rows):
    return random.uniform(LIMITS[:, 0], LIMITS[:, 1], size=(rows, JOINTS))


def rotation_vector(r):
    """Of rotations near none."""
    return np.stack([r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]], 1) / 2


def floor(arm, q, judged, study):
    """Least rms error of the tool point at `judged` that any unbiased fit of all displacements has."""

    def jacobian(q):
        nominal = tool_poses(*arm, q)
        columns = []
        for k in range(6 * (JOINTS + 2)):
            step = np.zeros((JOINTS + 2, 6))
            step.flat[k] = 1e-6
            one, other = tool_poses(*moved(arm, step), q), tool_poses(*moved(arm, -step), q)
            turn = rotation_vector((one - other)[:, :3, :3] @ nominal[:, :3, :3].transpose(0, 2, 1))
            columns.append(np.hstack([(one - other)[:, :3, 3], turn]) / 2e-6)
        return np.stack(columns, 2)

    seen = KINDS[study.kind]
    noise = np.array([study.sigma] * 3 + [ORIENTATION_SIGMA] * 3)[:seen]
    fitted = (jacobian(q)[:, :seen] / noise[:, None]).reshape(-1, 6 * (JOINTS + 2))
    _, s, v = np.linalg.svd(fitted, full_matrices=False)
    seen = s > 1e-7 * s[0]
    spread = jacobian(judged)[:, :3] @ (v[seen].T / s[seen])
    return float(np.sqrt((spread**2).sum((1, 2)).mean())), int(seen.sum())


# --- files


def quaternions(r):
    """qw, qx, qy, qz: the eigenvector of the largest eigenvalue, well defined at every angle."""
    xx, xy, xz, yx, yy, yz, zx, zy, zz = r.reshape(-1, 9).T
    k = np.array(
        [
            [xx + yy + zz, zy - yz, xz - zx, yx - xy],
            [zy - yz, xx - yy - zz, xy + yx, xz + zx],
            [xz - zx, xy + yx, yy - xx - zz, yz + zy],
            [yx - xy, xz + zx, yz + zy, zz - xx - yy],
        ]
    ).transpose(2, 0, 1)
    return np.linalg.eigh(k)[1][:, :, 3]


def roll_pitch_yaw(r):
    return np.stack(
        [
            np.arctan2(r[..., 2, 1], r[..., 2, 2]),
            np.arctan2(-r[..., 2, 0], np.hypot(r[..., 2, 1], r[..., 2, 2])),
            np.arctan2(r[..., 1, 0], r[..., 0, 0]),
        ],
        -1,
    )


def write_csv(path, columns, rows):
    with open(path, "w", newline="") as file:
        out = csv.writer(file)
        out.writerow(columns)
        out.writerows([[v if isinstance(v, str) else repr(float(v)) for v in row] for row in rows])


def write_robot(directory):
    deg = np.rad2deg
    text = 'name = "arm"\n'
    for (alpha, a, theta, d), limits in zip(DRAWING, deg(LIMITS)):
        text += f"""[[joint]]
type = "revolute"
convention = "mdh"
alpha_deg = {deg(alpha):.10g}
a_mm = {1e3 * a:.10g}
theta_deg = {deg(theta):.10g}
d_mm = {1e3 * d:.10g}
limits_deg = [{limits[0]:.10g}, {limits[1]:.10g}]
"""
    text += "[tool]\nxyz_mm = [" + ", ".join(f"{1e3 * v:.10g}" for v in TOOL) + "]\n"
    (directory / "arm.toml").write_text(text)

    links = [f'<link name="link_{k}"/>' for k in range(JOINTS + 1)] + ['<link name="tool"/>']
    frames = [link(*row) for row in DRAWING] + [shifted(*TOOL)]
    for k, frame in enumerate(frames):
        xyz, rpy = (" ".join(repr(float(v)) for v in w) for w in (frame[:3, 3], roll_pitch_yaw(frame[:3, :3])))
        fixed = k == JOINTS
        child = "tool" if fixed else f"link_{k + 1}"
        joint = 'name="flange" type="fixed"' if fixed else f'name="joint_{k + 1}" type="revolute"'
        limits = "" if fixed else 'lower="{}" upper="{}" effort="1" velocity="1"'.format(*LIMITS[k])
        links.append(
            f'<joint {joint}><parent link="link_{k}"/><child link="{child}"/><origin xyz="{xyz}" rpy="{rpy}"/>'
            f'<axis xyz="0 0 1"/>{limits and f"<limit {limits}/>"}</joint>'
        )
    (directory / "arm.urdf").write_text('<robot name="arm">\n' + "\n".join(links) + "\n</robot>\n")


def cases(directory, name):
    return [directory / f"{name}-{seed}" for seed in range(SEEDS)]


def simulate(directory):
    directory.mkdir(parents=True, exist_ok=True)
    write_robot(directory)
    q_columns = [f"q{k + 1}" for k in range(JOINTS)]
    for (name, study), seed in itertools.product(STUDIES.items(), range(SEEDS)):
        case = cases(directory, name)[seed]
        case.mkdir(exist_ok=True)
        random = np.random.default_rng([list(ARMS).index(study.arm), seed])
        true = true_arm(study.arm, random)
        rows = study.rows + CHECKED
        q, judged = joints(random, rows), joints(random, JUDGED)
        t = tool_poses(*true, q)
        position = t[:, :3, 3] + random.normal(size=(rows, 3)) * study.sigma
        tilt = [placed(0, 0, 0, *w) for w in random.normal(size=(rows, 3)) * ORIENTATION_SIGMA]
        rotation = t[:, :3, :3] @ np.array(tilt)[:, :3, :3]
        best, rank = floor(true, q[: study.rows], judged, study)
        nominal = tool_poses(*drawn(), judged)[:, :3, 3]
        actual = tool_poses(*true, judged)[:, :3, 3]
        fitted = {"q": q[: study.rows], "position": position[: study.rows]}
        np.savez(case / "truth.npz", **fitted, judged=judged, actual=actual)
        (case / "floor.json").write_text(json.dumps({"rms": best, "rank": rank, **errors(nominal, actual)}))

        pose = study.kind == "pose"
        columns = q_columns + ["x", "y", "z"] + ["qw", "qx", "qy", "qz"] * pose + ["set"]
        seen = np.hstack([q, position, quaternions(rotation)] if pose else [q, position])
        sets = ["identify"] * study.rows + ["verify"] * CHECKED
        write_csv(case / "data.csv", columns, [[*row, of] for row, of in zip(seen, sets)])
        sigmas = f"position_sigma_mm = {1e3 * study.sigma}\n"
        sigmas += f"orientation_sigma_deg = {np.rad2deg(ORIENTATION_SIGMA)}\n" * pose
        (case / "data.toml").write_text(sigmas)
        zeros = np.zeros((JUDGED, 3))
        write_csv(case / "judged.csv", q_columns + ["x", "y", "z"], np.hstack([judged, zeros]))
        names = ["x1", "y1", "z1"] + ["phix1", "phiy1", "phiz1"] * pose
        names += [f"joint_{k + 1}" for k in range(JOINTS)]
        seen = np.hstack([position, roll_pitch_yaw(rotation), q] if pose else [position, q])
        write_csv(case / "figaroh.csv", names, seen[: study.rows])


def errors(predicted, actual):
    """rms and max distance over the judged rows, m."""
    e = np.linalg.norm(predicted - actual, axis=1)
    return {"error_rms": float(np.sqrt((e**2).mean())), "error_max": float(e.max())}


def cpu(who=resource.RUSAGE_SELF):
    used = resource.getrusage(who)
    return used.ru_utime + used.ru_stime


# --- the tools


def fit_truepose(case, study, truth, program, *options):
    before = cpu(resource.RUSAGE_CHILDREN)
    command = [program, "identify", "--robot", case.parent / "arm.toml", "--data", case / "data.csv"]
    command += ["--out", case / "arm.tpb", "--json", case / "report.json", *options]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    seconds = cpu(resource.RUSAGE_CHILDREN) - before
    command = [program, "predict", "--params", case / "arm.tpb", "--data", case / "judged.csv"]
    subprocess.run(command + ["--out", case / "predicted.csv"], check=True, stdout=subprocess.DEVNULL)
    with open(case / "predicted.csv") as file:
        predicted = np.array([[float(row[c]) for c in "xyz"] for row in csv.DictReader(file)])
    status = [p["status"] for p in json.loads((case / "report.json").read_text())["parameters"]]
    return predicted, seconds, status.count("identified"), len(status) - status.count("identified")


def fit_pybotics(case, study, truth, _, residual):
    """As its example notebook does, with all parameters free but the tool's turn. mm, as its models.

    `residual`: "distance" is pybotics' own, "component" ours, from its forward kinematics.
    """
    from pybotics.geometry import position_from_matrix
    from pybotics.optimization import OptimizationHandler, optimize_accuracy
    from pybotics.robot import Robot
    from pybotics.tool import Tool
    from scipy.optimize import least_squares

    robot = Robot.from_parameters(DRAWING * [1, 1e3, 1, 1e3])
    robot.tool = Tool(shifted(*(1e3 * TOOL)))
    handler = OptimizationHandler(robot, True, [True] * 3 + [False] * 3, True)

    def components(vector, handler, q, position):
        handler.apply_optimization_vector(vector)
        return np.ravel([position_from_matrix(handler.robot.fk(row)) for row in q] - position)

    before = cpu()
    found = least_squares(
        components if residual == "component" else optimize_accuracy,
        handler.generate_optimization_vector(),
        args=(handler, truth["q"], 1e3 * truth["position"]),
        max_nfev=EVALUATIONS,
    )
    seconds = cpu() - before
    handler.apply_optimization_vector(found.x)
    predicted = np.array([position_from_matrix(handler.robot.fk(row)) for row in truth["judged"]]) / 1e3
    return predicted, seconds, len(found.x), 0


def fit_figaroh(case, study, truth, _, method):
    """A subclass of its BaseCalibration with the cost function that its documentation asks for."""
    import logging

    from figaroh.calibration.base_calibration import BaseCalibration
    from figaroh.calibration.calibration_tools import calc_updated_fkm
    from figaroh.tools.robot import Robot

    logging.disable(logging.INFO)
    seen = [k < KINDS[study.kind] for k in range(6)]
    task = {
        # the cost function's residuals have unit noise
        "parameters": {"calibration_level": "full_params", "estimation": {"method": method, "noise_std": 1.0}},
        "kinematics": {"base_frame": "universe", "tool_frame": "tool"},
        "measurements": {"markers": [{"name": "tool", "measurable_dof": seen}], "poses": {"base_pose": [0.0] * 6}},
        "data": {"source_file": str(case / "figaroh.csv"), "number_of_samples": study.rows},
    }
    active = {"active_joints": [f"joint_{k + 1}" for k in range(JOINTS)]}
    robot = {"name": "arm", "properties": {"joints": active}}
    config = case / "figaroh.yaml"
    config.write_text(json.dumps({"schema_version": "2.0", "robot": robot, "tasks": {"calibration": task}}))

    class Calibration(BaseCalibration):
        def cost_function(self, var):
            estimated = calc_updated_fkm(self.model, self.data, var, self.q_measured, self.calib_config)
            residuals = self._compute_logmap_residuals(self.PEE_measured, estimated)
            return self.apply_measurement_weighting(residuals, 1 / study.sigma, 1 / ORIENTATION_SIGMA)

    calibration = Calibration(Robot(str(case.parent / "arm.urdf"), str(case.parent)), str(config))
    calibration.calib_config["known_baseframe"] = False
    calibration.calib_config["known_tipframe"] = False
    calibration.load_data_set()
    before = cpu()
    calibration.create_param_list()
    found, _ = calibration.solve_optimisation()
    calibration.calc_stddev(found)
    seconds = cpu() - before
    judged = dict(calibration.calib_config, NbSample=JUDGED, calibration_index=3)
    judged["measurability"] = [True] * 3 + [False] * 3
    predicted = calc_updated_fkm(calibration.model, calibration.data, found.x, truth["judged"], judged)
    named = calibration.calib_config["absorbed_param_name"]
    return predicted.reshape(3, -1).T, seconds, len(found.x), len(named)


PRIOR = ["--estimator", "minimum-variance"]
WAYS = {
    "truepose": (fit_truepose, []),
    "truepose, minimum-variance": (fit_truepose, PRIOR + ["--prior-mm", "1", "--prior-deg", "0.1"]),
    "truepose, cross-validated": (fit_truepose, PRIOR + ["--prior", "cross-validated"]),
    "pybotics": (fit_pybotics, ["distance"]),
    "pybotics, component": (fit_pybotics, ["component"]),
    "figaroh, structural": (fit_figaroh, ["structural"]),
    "figaroh, excitation": (fit_figaroh, ["excitation"]),
    "figaroh, map": (fit_figaroh, ["map"]),
    "figaroh, map_cv": (fit_figaroh, ["map_cv"]),
}


def fit(directory, tool, program):
    for name, study in STUDIES.items():
        for case, way in itertools.product(cases(directory, name), study.ways):
            if way.split(",")[0] == tool:
                function, how = WAYS[way]
                truth = np.load(case / "truth.npz")
                predicted, *figures = function(case, study, truth, program, *how)
                result = dict(zip(["seconds", "fitted", "named"], figures))
                result.update(errors(predicted, truth["actual"]))
                (case / f"{way}.json").write_text(json.dumps(result))


def table(directory):
    for name, study in STUDIES.items():

        def read(way, key):
            files = [case / f"{way}.json" for case in cases(directory, name)]
            return np.array([json.loads(file.read_text())[key] for file in files])

        def rms(way, key="error_rms"):
            return 1e6 * np.sqrt((read(way, key) ** 2).mean())

        least, rank = rms("floor", "rms"), read("floor", "rank")[0]
        print(f"\n{study.rows} {study.kind}s, noise {1e6 * study.sigma:.0f} um, {ARMS[study.arm]}: ", end="")
        print(f"as drawn {rms('floor') / 1e3:.2f} mm rms, floor {least:.1f} um, {rank} parameters to tell.\n")
        print("| | rms, um | over the floor | most, um | fitted | named as not seen | processor time |")
        print("| --- | --- | --- | --- | --- | --- | --- |")
        for way in study.ways:
            cells = [f"{rms(way):.1f}", f"{rms(way) / least:.2f}", f"{1e6 * read(way, 'error_max').max():.0f}"]
            for key in "fitted", "named":
                cells.append("-".join(str(n) for n in dict.fromkeys(np.sort(read(way, key))[[0, -1]])))
            cells.append(f"{np.median(read(way, 'seconds')) / np.median(read('truepose', 'seconds')):.3g}")
            print(f"| {way} | {' | '.join(cells)} |")


if __name__ == "__main__":
    what, directory, *program = sys.argv[1:]
    directory = pathlib.Path(directory)
    if what == "simulate":
        simulate(directory)
    elif what == "table":
        table(directory)
    else:
        fit(directory, what, *(program or [None]))
