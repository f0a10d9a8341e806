// SPDX-License-Identifier: Apache-2.0
// Tone curves: what is brighter than a display can show is compressed rather than cut off.
#pragma once

#include <core/image.h>
#include <core/math.h>
#include <core/settings.h>

namespace stipple {

// From scene-linear to display-linear, in [0, 1] but for kNone, which leaves everything as it is.
// Hable. Filmic Tonemapping Operators. 2010. -- Narkowicz. ACES Filmic Tone Mapping Curve. 2016. --
// Sobotka. AgX. 2022, by the polynomial of Wrensch. Minimal AgX Implementation. 2023.
Vec3 toneMapped(Tone tone, const Vec3& color);

// The colour channels (premultiplied, if there is alpha) of a picture that is to be shown.
void applyTone(Tone tone, Image& image);

}  // namespace stipple
