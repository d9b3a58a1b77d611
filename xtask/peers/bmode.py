"""A plain NumPy B-mode of the same size, as the peer of `ultrasound_frame_ms`: 256 lines x 1,024 samples, three layers and a
vessel, attenuation there and back, Gaussian scatterers, pulse and beam by separable convolution, envelope, logarithm."""

import statistics
import time

import numpy as np

LINES, SAMPLES, DEPTH_MM, WIDTH_MM, MHZ = 256, 1024, 16.0, 30.0, 10.0


def bell(sigma, taps):
    kernel = np.exp(-0.5 * (np.arange(-taps, taps + 1) / sigma) ** 2).astype(np.float32)
    return kernel / np.sqrt((kernel**2).sum())


def frame(noise):
    step_cm = 0.1 * DEPTH_MM / SAMPLES
    z = (np.arange(SAMPLES) + 0.5) * DEPTH_MM / SAMPLES
    attenuation = np.select([z < 2.0, z < 4.8, z < 7.8], [1.8, 0.63, 0.18], 1.09).astype(np.float32)
    speckle_db = np.select([z < 2.0, z < 4.8, z < 7.8], [-33.0, -46.0, -72.0], -38.0).astype(np.float32)
    lost_db = np.cumsum(2.0 * attenuation * MHZ * step_cm)
    amplitude = 10.0 ** ((speckle_db - lost_db) / 20.0)
    iq = noise * amplitude
    for top in (2.0, 4.8, 7.8):
        iq[:, int(top / DEPTH_MM * SAMPLES)] += 0.1
    pulse, beam = bell(4.2, 5), bell(2.1, 3)
    pulsed = np.zeros_like(iq)
    for tap, weight in enumerate(pulse):
        pulsed += weight * np.roll(iq, tap - 5, axis=1)
    image = np.zeros_like(iq)
    for tap, weight in enumerate(beam):
        image += weight * np.roll(pulsed, tap - 3, axis=0)
    power = image.real**2 + image.imag**2
    db = 10.0 * np.log10(np.maximum(power, 1e-30)) + 16.0 * (z * 0.1)
    return np.clip((db + 88.0) / 70.0 * 255.0, 0, 255).astype(np.uint8)


def main():
    random = np.random.default_rng(1)
    noise = (random.standard_normal((LINES, SAMPLES)) + 1j * random.standard_normal((LINES, SAMPLES))).astype(np.complex64)
    times = []
    for _ in range(40):
        begin = time.perf_counter()
        frame(noise)
        times.append(1e3 * (time.perf_counter() - begin))
    print(f"ultrasound_frame_ms.peer=NumPy-{np.__version__} ultrasound_frame_ms.peer_value={statistics.median(times):.3f}")


main()
