// SPDX-License-Identifier: Apache-2.0
// JSON from strangers: parsing with line and column, and validation against a JSON Schema with the
// place of what is wrong. nlohmann-json and valijson underneath; valijson is seen by json.cpp only.
#pragma once

#include <core/error.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace stipple {

using Json = nlohmann::json;

// Throws kParse ("where: line 3, column 7: ..."), also for a key that an object holds twice and for
// more than 64 levels of nesting (recursive readers would overflow their stack).
Json parseJson(std::string_view text, const std::string& where);

// Steps from the root of a document: keys and indices.
using JsonPath = std::vector<std::string>;
std::string jsonPointer(const JsonPath& path);  // "/assets/oak/height"; "/" for the root
std::string gltfPath(const JsonPath& path);     // "meshes[0].primitives[1]"; "root" for the root

// `text` without line breaks and other control characters and cut after `max_length` bytes: fit for
// an error line.
std::string oneLine(std::string_view text, size_t max_length = 120);
std::string inQuotes(std::string_view text);  // the same, between double quotes
// What to say of a name that is not among the known: "; did you mean "oak"?", or which these are if
// they are few, or nothing.
std::string nameHint(const std::string& name, const std::vector<std::string>& known);

// A compiled JSON Schema (draft 7).
class JsonSchema {
public:
    // definition: validate against this entry of the schema's "definitions"; empty: against the
    // whole.
    explicit JsonSchema(const char* schema_text, const std::string& definition = "");
    ~JsonSchema();

    struct Problem {
        JsonPath path;  // within the validated value
        std::string message;
    };
    // The first thing that is wrong, none if the value is valid. About 4 us for an object of a few
    // keys.
    std::optional<Problem> firstProblem(const Json& value) const;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace stipple
