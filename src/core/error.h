// SPDX-License-Identifier: Apache-2.0
// Errors with a place. Thrown while loading and setting up; hot loops never throw.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

namespace stipple {

enum class ErrorCode {
    kInvalidArgument,  // a setting or an option is out of range or contradicts another
    kFileNotFound,
    kParse,         // the file is not what its format says
    kInvalidScene,  // well-formed, but makes no sense: cycles, unknown names, singular transforms
    kUnsupported,
    kOutOfMemory,  // would exceed the memory limit
    kIo,           // writing failed
    kCancelled,
    kInternal,
};

// what() is one line: "where: message", for example
// "scene.glb: meshes[3].primitives[0]: index 912 >= vertex count 900".
class Error : public std::runtime_error {
public:
    Error(ErrorCode code, const std::string& where, const std::string& message)
        : std::runtime_error(where.empty() ? message : where + ": " + message),
          code_(code),
          where_(where) {}

    ErrorCode code() const { return code_; }
    const std::string& where() const { return where_; }

private:
    ErrorCode code_;
    std::string where_;
};

// Collects warnings; owned by the caller, never global.
struct Diagnostics {
    std::vector<std::string> warnings;

    void warn(const std::string& where, const std::string& message) {
        warnings.push_back(where.empty() ? message : where + ": " + message);
    }
};

}  // namespace stipple
