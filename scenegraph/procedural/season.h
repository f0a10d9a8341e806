// SPDX-License-Identifier: Apache-2.0
// The time of year, as plants show it.
#pragma once

#include <string>

namespace stipple {

enum class Season { kSpring, kSummer, kAutumn, kWinter };

// spring, summer, autumn or winter. Throws kInvalidArgument for anything else.
Season seasonByName(const std::string& name);

}  // namespace stipple
