"""The Hurwitz zeta function of negative numbers, which tells how far the trapezoidal rule errs at a root or a kink."""


def hurwitz_zeta(p, a):
    """zeta(-p, a) for 0 < p < 4 and 0 <= a <= 1, to about 1e-8; plain arithmetic, for NumPy and for kernels.

    With x = a + 4 (Euler and Maclaurin):

        zeta(-p, a) = a^p + ... + (a + 3)^p - x^(p+1)/(p + 1) + x^p/2 - p x^(p-1)/12 + p (p-1) (p-2) x^(p-3)/720
                      - p (p-1) (p-2) (p-3) (p-4) x^(p-5)/30240

    Parameters
    ----------
    p : float
        Negative of the first argument [1].
    a : float or ndarray
        Second argument [1].

    References
    ----------
    NIST Digital Library of Mathematical Functions, 25.11.5 and 25.11.6.
    """
    x = a + 4.0
    zeta = a**p + (a + 1.0) ** p + (a + 2.0) ** p + (a + 3.0) ** p - x ** (p + 1.0) / (p + 1.0) + 0.5 * x**p
    zeta -= p * x ** (p - 1.0) / 12.0
    factor = p * (p - 1.0) * (p - 2.0)
    zeta += factor * x ** (p - 3.0) / 720.0
    return zeta - factor * (p - 3.0) * (p - 4.0) * x ** (p - 5.0) / 30240.0
