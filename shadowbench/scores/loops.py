"""Compiled loops over pixels, equal to SciPy's and NumPy's to the bit. Imported where called, as it takes 0.3 s."""

import numba
import numpy as np

from shadowbench.compiled import compiled

_TILE = (32, 128)  # windows whose sums, in float64, fit into the processor's cache


@compiled()
def squared_distance(to):  # type: ignore[no-untyped-def]
    """(H, W) int32 squared distance in pixels from each pixel to the nearest in `to` (H, W), not empty.

    By Felzenszwalb, Huttenlocher 2012, "Distance Transforms of Sampled Functions".
    """
    height, width = to.shape
    far = height + width  # its square is above every distance
    squared = np.empty((height, width), np.int32)  # at first the distance along the column
    nearest = np.full(width, far, np.int32)
    for y in range(height):
        for x in range(width):
            nearest[x] = 0 if to[y, x] else min(nearest[x] + 1, far)
            squared[y, x] = nearest[x]
    nearest[:] = far
    height_of = np.empty(width, np.int64)  # of the parabolas' vertices
    vertex = np.empty(width, np.int32)  # columns of the parabolas in the envelope
    begin = np.empty(width + 1, np.int64)  # columns from which each is lowest
    for y in range(height - 1, -1, -1):
        for x in range(width):
            nearest[x] = min(squared[y, x], nearest[x] + 1)
            height_of[x] = np.int64(nearest[x]) * nearest[x]
        count = 0
        for x in range(width):
            first = 0
            while count > 0:
                last = vertex[count - 1]
                rise = height_of[x] + x * x - height_of[last] - last * last
                # Exact: the quotient of a whole number below 2^53, if not whole, is no rounding error from one.
                first = int(np.floor(np.float64(rise) / np.float64(2 * (x - last)))) + 1
                if first > begin[count - 1]:
                    break
                count -= 1
            if count == 0:
                first = 0
            if first < width:
                vertex[count], begin[count] = x, first
                count += 1
        begin[count] = width
        for i in range(count):
            x0, lowest = vertex[i], height_of[vertex[i]]
            for x in range(begin[i], begin[i + 1]):
                squared[y, x] = (x - x0) * (x - x0) + lowest
    return squared


@numba.njit(inline="always")
def _window_sums(image, weights, column, sums, height, width):  # type: ignore[no-untyped-def]
    """Weighted sums over the windows in the first rows and columns of an image; column: room for one of its rows."""
    radius = len(weights) // 2
    for y in range(height):
        for x in range(width + 2 * radius):
            total = image[y + radius, x] * weights[radius]
            for k in range(radius):
                total += (image[y + k, x] + image[y + 2 * radius - k, x]) * weights[k]
            column[x] = total
        for x in range(width):
            total = column[x + radius] * weights[radius]
            for k in range(radius):
                total += (column[x + k] + column[x + 2 * radius - k]) * weights[k]
            sums[y, x] = total


@compiled(error_model="numpy")  # 0/0 in windows without a valid pixel
def ssim_map(values, truth, valid, weights, c1, c2):  # type: ignore[no-untyped-def]
    """SSIM of float32 `values` and `truth` (H, W) in [0, 1] over the `valid` (H, W) pixels of windows inside the image.

    Returns float32, empty for an image smaller than a window; NaN for windows without a valid pixel, whose centres are
    invalid too. A window's weights are rescaled over its valid pixels. `weights`, of rows and columns, are symmetric
    and a tuple, with which the loop is seven times as fast as with an array. In float32 the variance, a difference of
    nearly equal numbers, would be off by 1e-4 in a flat region.
    """
    border = len(weights) - 1
    rows, columns = max(valid.shape[0] - border, 0), max(valid.shape[1] - border, 0)
    similarity = np.empty((rows, columns), np.float32)
    mask, true, product = np.empty((3, _TILE[0] + border, _TILE[1] + border))
    weight, mean, mean_t, square, square_t, joint = np.empty((6, *_TILE))
    column = np.empty(_TILE[1] + border)
    for y0 in range(0, rows, _TILE[0]):
        height = min(_TILE[0], rows - y0)
        for x0 in range(0, columns, _TILE[1]):
            width = min(_TILE[1], columns - x0)
            for y in range(height + border):
                for x in range(width + border):
                    counted = np.float64(valid[y0 + y, x0 + x])
                    mask[y, x], true[y, x] = values[y0 + y, x0 + x] * counted, truth[y0 + y, x0 + x] * counted
                    product[y, x] = counted
            _window_sums(product, weights, column, weight, height, width)
            _window_sums(mask, weights, column, mean, height, width)
            _window_sums(true, weights, column, mean_t, height, width)
            for y in range(height + border):
                for x in range(width + border):
                    product[y, x] = mask[y, x] * true[y, x]
                    mask[y, x] *= mask[y, x]
                    true[y, x] *= true[y, x]
            _window_sums(mask, weights, column, square, height, width)
            _window_sums(true, weights, column, square_t, height, width)
            _window_sums(product, weights, column, joint, height, width)
            for y in range(height):
                for x in range(width):
                    n = weight[y, x]
                    a, b = mean[y, x] / n, mean_t[y, x] / n
                    variances = (square[y, x] / n - a * a) + (square_t[y, x] / n - b * b)
                    covariance = joint[y, x] / n - a * b
                    luminance = (2 * a * b + c1) / (a * a + b * b + c1)
                    similarity[y0 + y, x0 + x] = luminance * (2 * covariance + c2) / (variances + c2)
    return similarity


@compiled()
def step_squared(values, valid):  # type: ignore[no-untyped-def]
    """(H, W) squared gradient by central differences, per pixel; along an axis only where both neighbours are valid."""
    height, width = values.shape
    squared, half = np.zeros((height, width), np.float32), np.float32(0.5)
    for y in range(height):
        if 0 < y < height - 1:
            for x in range(width):
                step = (values[y + 1, x] - values[y - 1, x]) * half
                squared[y, x] = step * step if valid[y + 1, x] & valid[y - 1, x] else np.float32(0)
        for x in range(1, width - 1):
            step = (values[y, x + 1] - values[y, x - 1]) * half
            squared[y, x] += step * step if valid[y, x + 1] & valid[y, x - 1] else np.float32(0)
    return squared


@numba.njit(inline="always")
def sample(values, valid, row, column):  # type: ignore[no-untyped-def]
    """Bilinear samples at a point: of values (H, W), 0 where not valid, and of `valid`; both 0 outside the image."""
    # Without branches, and with indices that cannot be negative, it is three times as fast.
    height, width = values.shape
    inside = np.float64((row >= 0) & (row <= height - 1) & (column >= 0) & (column <= width - 1))
    top, left = min(max(int(row), 0), height - 1), min(max(int(column), 0), width - 1)
    up, near = 1 - (np.float64(row) - top), 1 - (np.float64(column) - left)
    down, far = 1 - up, 1 - near
    below, right = np.uint64(min(top + 1, height - 1)), np.uint64(min(left + 1, width - 1))
    top, left = np.uint64(top), np.uint64(left)
    a, b = inside * valid[top, left], inside * valid[top, right]
    c, d = inside * valid[below, left], inside * valid[below, right]
    weight = a * up * near + b * up * far + c * down * near + d * down * far
    a, b, c, d = a * values[top, left], b * values[top, right], c * values[below, left], d * values[below, right]
    return np.float32(a * up * near + b * up * far + c * down * near + d * down * far), np.float32(weight)


@compiled()
def variances_along(values, valid, rows, columns, tangent, reach):  # type: ignore[no-untyped-def]
    """(P,) float64 squares by which values (H, W) at pixels differ from their mean along segments, n/(n − 1) times.

    rows, columns: (P,); tangent: (2, P) unit vectors along the segments, `reach` pixels long to either side. A pair of
    points counts by the product of its weights; NaN for no more than half a pair.
    """
    one, squares = np.float32(1), np.empty(len(rows))
    for i in range(len(rows)):
        row, column, here = np.float32(rows[i]), np.float32(columns[i]), values[rows[i], columns[i]]
        total = pairs = np.float32(0)
        for step in range(1, reach + 1):
            down, right = np.float32(step) * tangent[0, i], np.float32(step) * tangent[1, i]
            ahead, weight_ahead = sample(values, valid, row + down, column + right)
            behind, weight_behind = sample(values, valid, row - down, column - right)
            total += weight_behind * ahead + weight_ahead * behind
            pairs += weight_ahead * weight_behind
        number = one + (pairs + pairs)
        away = np.float64(here - (here + total) / number)
        squares[i] = away * away * number / (number - one) if number > 2 else np.nan
    return squares
