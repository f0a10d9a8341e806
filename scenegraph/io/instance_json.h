// SPDX-License-Identifier: Apache-2.0
// An instance as scene files and edit scripts write it: what it shows and its transform. Internal.
#pragma once

#include <scenegraph/io/json.h>
#include <scenegraph/io/transform.h>

namespace stipple {

inline constexpr double kMaxInstanceLength = 1e9;  // as in the schema

struct JsonInstance {
    const std::string* child = nullptr;
    DVec3 translation = DVec3(0), angles = DVec3(0), scale = DVec3(1);
    double quaternion[4] = {0, 0, 0, 1};
    double matrix[16];
    bool has_parts = false, has_angles = false, has_quaternion = false, has_matrix = false;
};

// False for anything but n numbers, none beyond the limit.
bool readNumbers(const Json& value, size_t n, double limit, double* result);

// False for anything that is not exactly as the schema's "instance" has it, which then says
// why. The result points into the source.
bool readInstance(const Json& source, JsonInstance& result);

// nullptr, or what is wrong.
const char* makeTransform(const JsonInstance& instance, Affine& result);

}  // namespace stipple
