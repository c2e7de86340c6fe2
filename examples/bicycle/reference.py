"""The bicycle by Lagrange's equations with multipliers, and its linear equations by the appendix of the benchmark: run.csv.

Coordinates and signs are those of the benchmark (x forward, y to the right, z down): place of the centre of the rear wheel, yaw,
lean, pitch, steer, turns of both wheels. All three components of the velocity of each contact vanish.

    python3 reference.py            needs numpy, scipy and mpmath
"""

import csv
from pathlib import Path

import mpmath as mp
import numpy as np
from scipy.integrate import solve_ivp

HERE = Path(__file__).parent
W, C, TILT, G = 1.02, 0.08, np.pi / 10, 9.81
R_REAR, R_FRONT = 0.3, 0.35
# Mass, centre of mass from the rear contact, inertia about it, of rear frame, handlebar, rear wheel, front wheel.
FRAME = (85.0, [0.3, 0, -0.9], [[9.2, 0, 2.4], [0, 11, 0], [2.4, 0, 2.8]])
BAR = (4.0, [0.9, 0, -0.7], [[0.05892, 0, -0.00756], [0, 0.06, 0], [-0.00756, 0, 0.00708]])
REAR = (2.0, np.diag([0.0603, 0.12, 0.0603]))
FRONT = (3.0, np.diag([0.1405, 0.28, 0.1405]))
DOWN = np.array([0.0, 0, 1])
AXIS = np.array([np.sin(TILT), 0, np.cos(TILT)])


def skew(a):
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def turn(axis, angle):
    s = skew(axis)
    return np.eye(3) + np.sin(angle) * s + (1 - np.cos(angle)) * (s @ s)


def kinematics(q):
    """For each body mass, inertia in the world, and what its velocities have of each speed; the same for both contacts."""
    hub = q[:3]
    yaw = turn(DOWN, q[3])
    lean = yaw @ turn(np.array([1.0, 0, 0]), q[4])
    frame = lean @ turn(np.array([0, 1.0, 0]), q[5])
    fork = frame @ turn(AXIS, q[6])
    zero = np.zeros(3)
    own = np.array([W + C, 0, R_REAR])  # where the axis of steering meets the ground, from the rear hub
    head = hub + frame @ own

    def velocity(place, w, steered):
        """Of a point of the frame, or of what is steered, that turns with w."""
        v = np.zeros((3, 9), w.dtype)
        v[:, :3] = np.eye(3)
        for k in (3, 4, 5):
            v[:, k] = np.cross(w[:, k], place - hub)
        if steered:
            v[:, 6] = np.cross(w[:, 6], place - head)
        return v

    w_frame = np.stack([zero, zero, zero, DOWN, yaw[:, 0], lean[:, 1], zero, zero, zero], 1).astype(frame.dtype)
    w_fork = w_frame.copy()
    w_fork[:, 6] = frame @ AXIS
    w_rear, w_front = w_frame.copy(), w_fork.copy()
    w_rear[:, 7] = frame[:, 1]
    w_front[:, 8] = fork[:, 1]
    bodies, contacts = [], []

    def body(mass, inertia, R, place, w, steered):
        bodies.append((mass, R @ inertia @ R.T, w, velocity(place, w, steered), place))

    body(FRAME[0], np.array(FRAME[2]), frame, hub + frame @ (np.array(FRAME[1]) + [0, 0, R_REAR]), w_frame, False)
    body(BAR[0], np.array(BAR[2]), fork, head + fork @ (np.array(BAR[1]) - [W + C, 0, 0]), w_fork, True)
    front = head + fork @ np.array([-C, 0, -R_FRONT])
    body(*REAR, frame, hub, w_rear, False)
    body(*FRONT, fork, front, w_front, True)
    for R, radius, w, place, steered in [(frame, R_REAR, w_rear, hub, False), (fork, R_FRONT, w_front, front, True)]:
        n = R[:, 1]
        way = DOWN - n[2] * n
        way = radius * way / np.sqrt(way @ way)
        contacts.append(velocity(place, w, steered) - skew(way) @ w)
    return bodies, np.vstack(contacts)


def accelerations(q, qd):
    """Accelerations and forces of the ground."""
    step = 1e-30
    bodies, A = kinematics(q)
    moved, A_moved = kinematics(q + 1j * step * qd)
    M, f = np.zeros((9, 9)), np.zeros(9)
    for (mass, J, w, v, _), (_, _, w_moved, v_moved, _) in zip(bodies, moved):
        M += mass * v.T @ v + w.T @ J @ w
        turning = w @ qd
        f += v.T @ (mass * G * DOWN - mass * (v_moved.imag / step) @ qd)
        f -= w.T @ (J @ (w_moved.imag / step) @ qd + np.cross(turning, J @ turning))
    whole = np.block([[M, A.T], [A, np.zeros((6, 6))]])
    found = np.linalg.solve(whole, np.concatenate([f, -(A_moved.imag / step) @ qd]))
    return found[:9], found[9:]


def energy(q, qd):
    bodies, _ = kinematics(q)
    moving = sum(mass * (v @ qd) @ (v @ qd) + (w @ qd) @ J @ (w @ qd) for mass, J, w, v, _ in bodies) / 2
    return moving - G * sum(mass * place[2] for mass, _, _, _, place in bodies)


def start(speed, lean_rate):
    q = np.zeros(9)
    q[2] = -R_REAR
    _, A = kinematics(q)
    given = {4: lean_rate, 6: 0.0, 7: -speed / R_REAR}
    free = [k for k in range(9) if k not in given]
    qd = np.zeros(9)
    for k, value in given.items():
        qd[k] = value
    qd[free] = np.linalg.solve(A[:, free], -A[:, list(given)] @ list(given.values()))
    return q, qd


def run(speed, lean_rate, end):
    """Time, speed of the rear rim, lean, steer, pitch, yaw, place of the rear hub, load and grip of the front wheel."""
    state = np.concatenate(start(speed, lean_rate))
    at = np.arange(round(end * 10) + 1) / 10
    rates = lambda t, y: np.concatenate([y[9:], accelerations(y[:9], y[9:])[0]])
    done = solve_ivp(rates, (0, end), state, "DOP853", at, rtol=1e-12, atol=1e-13)
    assert done.success, done.message
    kept = [energy(y[:9], y[9:]) for y in done.y.T]
    print(f"{speed} m/s: energy kept to {np.ptp(kept) / kept[0]:.0e}")
    rows = []
    for t, y in zip(at, done.y.T):
        _, forces = accelerations(y[:9], y[9:])
        rows.append([t, -R_REAR * y[16], y[4], y[6], -y[5], -y[3], y[0], -y[1], forces[5], -forces[4]])
    return rows


def linear():
    """M, C1, K0, K2 of the appendix A of the benchmark, with 40 digits."""
    mp.mp.dps = 40
    number = lambda text: mp.mpf(str(text))
    w, c, g, tilt = number(W), number(C), number(G), mp.pi / 10
    r_r, r_f = number(R_REAR), number(R_FRONT)
    matrix = lambda rows: mp.matrix([[number(v) for v in row] for row in rows])
    m_b, (x_b, _, z_b), I_b = number(FRAME[0]), map(number, FRAME[1]), matrix(FRAME[2])
    m_h, (x_h, _, z_h), I_h = number(BAR[0]), map(number, BAR[1]), matrix(BAR[2])
    m_r, I_r = number(REAR[0]), [number(v) for v in np.diag(REAR[1])]
    m_f, I_f = number(FRONT[0]), [number(v) for v in np.diag(FRONT[1])]
    m = m_r + m_b + m_h + m_f
    x = (x_b * m_b + x_h * m_h + w * m_f) / m
    z = (-r_r * m_r + z_b * m_b + z_h * m_h - r_f * m_f) / m
    I_xx = I_r[0] + I_b[0, 0] + I_h[0, 0] + I_f[0] + m_r * r_r**2 + m_b * z_b**2 + m_h * z_h**2 + m_f * r_f**2
    I_xz = I_b[0, 2] + I_h[0, 2] - m_b * x_b * z_b - m_h * x_h * z_h + m_f * w * r_f
    I_zz = I_r[0] + I_b[2, 2] + I_h[2, 2] + I_f[0] + m_b * x_b**2 + m_h * x_h**2 + m_f * w**2
    m_a = m_h + m_f
    x_a, z_a = (x_h * m_h + w * m_f) / m_a, (z_h * m_h - r_f * m_f) / m_a
    A_xx = I_h[0, 0] + I_f[0] + m_h * (z_h - z_a) ** 2 + m_f * (r_f + z_a) ** 2
    A_xz = I_h[0, 2] - m_h * (x_h - x_a) * (z_h - z_a) + m_f * (w - x_a) * (r_f + z_a)
    A_zz = I_h[2, 2] + I_f[0] + m_h * (x_h - x_a) ** 2 + m_f * (w - x_a) ** 2
    sin, cos = mp.sin(tilt), mp.cos(tilt)
    u = (x_a - w - c) * cos - z_a * sin
    F_ss = m_a * u**2 + A_xx * sin**2 + 2 * A_xz * sin * cos + A_zz * cos**2
    F_sx = -m_a * u * z_a + A_xx * sin + A_xz * cos
    F_sz = m_a * u * x_a + A_xz * sin + A_zz * cos
    mu = c / w * cos
    S_r, S_f = I_r[1] / r_r, I_f[1] / r_f
    S_t, S_a = S_r + S_f, m_a * u + mu * m * x
    cross = F_sx + mu * I_xz
    M = mp.matrix([[I_xx, cross], [cross, F_ss + 2 * mu * F_sz + mu**2 * I_zz]])
    K0 = g * mp.matrix([[m * z, -S_a], [-S_a, -S_a * sin]])
    K2 = mp.matrix([[0, (S_t - m * z) / w * cos], [0, (S_a + S_f * sin) / w * cos]])
    C1 = mp.matrix([[0, mu * S_t + S_f * cos + I_xz / w * cos - mu * m * z], [-(mu * S_t + S_f * cos), 0]])
    C1[1, 1] = F_sz / w * cos + mu * (S_a + I_zz / w * cos)
    return M, C1, K0, K2


def eigenvalues(speed):
    M, C1, K0, K2 = linear()
    v = mp.mpf(speed)
    above = mp.inverse(M)
    A = mp.zeros(4)
    stiff, damped = -(above * (K0 + v**2 * K2)), -(above * (v * C1))
    for i in range(2):
        A[i, i + 2] = 1
        for j in range(2):
            A[i + 2, j], A[i + 2, j + 2] = stiff[i, j], damped[i, j]
    found = [mp.chop(e, 1e-30) for e in mp.eig(A, left=False, right=False)]
    return sorted(found, key=lambda e: (mp.nint(e.real * 10**20), e.imag))


def main():
    with open(HERE / "eigenvalues.csv", "w", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["v"] + [f"{part}{i}" for i in range(1, 5) for part in ("re", "im")])
        for v in range(11):
            out.writerow([v] + [mp.nstr(part, 17) for e in eigenvalues(v) for part in (e.real, e.imag)])
    head = ["t", "speed", "lean", "steer", "pitch", "yaw", "x", "y", "load", "grip"]
    for name, rows in [("run.csv", run(4.6, 0.5, 5.0)), ("fall.csv", run(3.0, 0.05, 2.0))]:
        with open(HERE / name, "w", newline="") as file:
            out = csv.writer(file, lineterminator="\n")
            out.writerow(head)
            out.writerows([repr(float(v)) for v in row] for row in rows)


main()
