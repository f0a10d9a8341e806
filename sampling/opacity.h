// SPDX-License-Identifier: Apache-2.0
// Points that lie on patches finer than a subpixel must not cover more of the picture than the patches do.
#pragma once

namespace stipple {

// Share of the drawn points that count, so that the expected coverage of a connected patch does not depend on K. A kept
// point covers a whole subpixel: on a patch much smaller than that, one point per subpixel of projected area is
// exactly right (coverage 1 - exp(-A) for randomly placed detail), more make it too opaque. On a patch of many subpixels
// all points count: they cover the same subpixels again. patch: the patch's diameter in subpixels; k: points per
// subpixel of projected area.
float patchOpacity(float patch, float k);

}  // namespace stipple
