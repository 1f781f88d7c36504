"""Andrews' squeezing mechanism, problem A03 of the multibody benchmark library: stiff, of full rank, one freedom.

Seven bodies, ten pins, one spring, a constant moment on the crank, from rest. Numbers and published solution at 0.03 s
(PSIDE at a tolerance of 1e-14) of the test set for initial value problem solvers, in the relative angles of Hairer
and Wanner, Solving Ordinary Differential Equations II: beta, Theta, gamma, Phi, delta, Omega, epsilon.
"""

import numpy as np

import redundax as rx

T1 = 0.03
_START = np.array(
    [
        -0.0617138900142764496358948458001,
        0.0,
        0.455279819163070380255912382449,
        0.222668390165885884674473185609,
        0.487364979543842550225598953530,
        -0.222668390165885884674473185609,
        1.23054744454982119249735015568,
    ]
)
PUBLISHED = np.array(
    [
        0.1581077119629904e2,
        -0.1575637105984298e2,
        0.4082224013073101e-1,
        -0.5347301163226948,
        0.5244099658805304,
        0.5347301163226948,
        0.1048080741042263e1,
    ]
)
_MASS = (0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498)
_INERTIA = (2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5)
_A, _B, _C = (-0.06934, -0.00227), (-0.03635, 0.03273), (0.014, 0.072)
_D, _DA, _E, _EA, _RR, _RA = 28e-3, 115e-4, 2e-2, 1421e-5, 7e-3, 92e-5
_SS, _SA, _SB, _SC, _SD = 35e-3, 1874e-5, 1043e-5, 18e-3, 2e-2
_ZT, _TA, _TB, _U, _UA, _UB, _ZF, _FA = 4e-2, 2308e-5, 916e-5, 4e-2, 1228e-5, 449e-5, 2e-2, 1421e-5


def mechanism() -> rx.Mechanism:
    """Bodies K1 to K7; pins O, A, B on the ground, P between three bodies."""
    bodies = [rx.Body(f"K{k + 1}", m, i) for k, (m, i) in enumerate(zip(_MASS, _INERTIA, strict=True))]
    p = (_DA - _D, 0.0)
    pins = [
        rx.Revolute("O", "K1", "ground", point_i=(-_RA, 0.0), point_j=(0.0, 0.0)),
        rx.Revolute("T", "K2", "K1", point_i=(_DA, 0.0), point_j=(_RR - _RA, 0.0)),
        rx.Revolute("B", "K3", "ground", point_i=(-_SB, _SA), point_j=_B),
        rx.Revolute("P3", "K3", "K2", point_i=(-_SB, _SA - _SS), point_j=p),
        rx.Revolute("P4", "K4", "K2", point_i=(0.0, -_EA), point_j=p),
        rx.Revolute("P6", "K6", "K2", point_i=(_FA, 0.0), point_j=p),
        rx.Revolute("Q", "K4", "K5", point_i=(0.0, _E - _EA), point_j=(_ZT - _TA, -_TB)),
        rx.Revolute("A5", "K5", "ground", point_i=(-_TA, -_TB), point_j=_A),
        rx.Revolute("S", "K6", "K7", point_i=(_FA - _ZF, 0.0), point_j=(_UB, _UA - _U)),
        rx.Revolute("A7", "K7", "ground", point_i=(_UB, _UA), point_j=_A),
    ]
    spring = rx.SpringDamper(
        "K3", "ground", point_i=(_SD - _SB, _SA - _SC), point_j=_C, stiffness=4530.0, free_length=0.07785
    )
    return rx.Mechanism(bodies, pins, loads=[rx.AppliedForce("K1", moment=0.033), spring])


def start() -> rx.State:
    """The published start, at rest."""
    beta, theta, gamma, phi, delta, omega, epsilon = _START
    angles = np.array([beta, beta + theta, gamma, phi + delta, delta, omega + epsilon, epsilon])
    along = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    across = np.stack([-np.sin(angles), np.cos(angles)], axis=1)
    tip, a, b = _RR * along[0], np.array(_A), np.array(_B)
    centres = np.array(
        [
            _RA * along[0],
            tip - _DA * along[1],
            b + _SB * along[2] - _SA * across[2],
            a + _ZT * along[4] - (_E - _EA) * across[3],
            a + _TA * along[4] + _TB * across[4],
            a - _U * across[6] + (_ZF - _FA) * along[5],
            a - _UA * across[6] - _UB * along[6],
        ]
    )
    return rx.State(q=np.concatenate([centres.ravel(), angles]), qd=np.zeros(21))


def relative_angles(q: np.ndarray) -> np.ndarray:
    """beta, Theta, gamma, Phi, delta, Omega, epsilon of a position."""
    beta, rod, gamma, four, delta, six, epsilon = np.asarray(q)[14:]
    return np.array([beta, rod - beta, gamma, four - delta, delta, six - epsilon, epsilon])
