// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/procedural/season.h>

#include <core/error.h>

namespace stipple {

Season seasonByName(const std::string& name) {
    if (name == "spring") return Season::kSpring;
    if (name == "summer") return Season::kSummer;
    if (name == "autumn") return Season::kAutumn;
    if (name == "winter") return Season::kWinter;
    throw Error(ErrorCode::kInvalidArgument, "",
                "unknown season '" + name + "' (spring, summer, autumn or winter)");
}

}  // namespace stipple
