// SPDX-License-Identifier: Apache-2.0
#include <core/nearest_name.h>
#include <scenegraph/io/json.h>

#include <algorithm>
#include <valijson/adapters/nlohmann_json_adapter.hpp>
#include <valijson/schema.hpp>
#include <valijson/schema_parser.hpp>
#include <valijson/validation_results.hpp>
#include <valijson/validator.hpp>

namespace stipple {

namespace {

constexpr size_t kMaxDepth = 64;

// Builds the document from the parser's events; refuses what nlohmann's own builder lets pass.
class DocumentBuilder : public nlohmann::json_sax<Json> {
public:
    Json root;
    std::string problem;
    size_t problem_byte = 0;  // 0: not known

    bool null() override { return put(nullptr); }
    bool boolean(bool v) override { return put(v); }
    bool number_integer(number_integer_t v) override { return put(v); }
    bool number_unsigned(number_unsigned_t v) override { return put(v); }
    bool number_float(number_float_t v, const string_t&) override { return put(v); }
    bool string(string_t& v) override { return put(std::move(v)); }
    bool binary(binary_t&) override { return false; }
    bool start_object(size_t) override { return open(Json::object()); }
    bool start_array(size_t) override { return open(Json::array()); }
    bool end_object() override { return close(); }
    bool end_array() override { return close(); }

    bool key(string_t& name) override {
        auto [it, is_new] = stack_.back()->get_ref<Json::object_t&>().try_emplace(name, nullptr);
        slot_ = &it->second;
        if (!is_new)
            problem = "key " + inQuotes(name) + " stands twice in " + jsonPointer(pathOfTop());
        return is_new;
    }

    bool parse_error(size_t byte, const std::string&, const Json::exception& e) override {
        problem = e.what();
        problem_byte = byte;
        // "[json.exception.parse_error.101] parse error at line 1, column 2: syntax error while
        // parsing value - ..."
        const size_t syntax = problem.find("syntax error");
        const size_t bracket = problem.find("] ");
        if (syntax != std::string::npos) {
            problem.erase(0, syntax);
        } else if (bracket != std::string::npos) {
            problem.erase(0, bracket + 2);
        }
        return false;
    }

private:
    // The place for the next value: the root, the value of the key just read, or a new element.
    Json* place() {
        if (stack_.empty()) return &root;
        if (stack_.back()->is_object()) return slot_;
        return &stack_.back()->get_ref<Json::array_t&>().emplace_back();
    }
    template <class T>
    bool put(T&& value) {
        *place() = std::forward<T>(value);
        return true;
    }
    bool open(Json&& empty) {
        if (stack_.size() == kMaxDepth) {
            problem = "nested more than " + std::to_string(kMaxDepth) + " levels deep";
            return false;
        }
        Json* p = place();
        *p = std::move(empty);
        stack_.push_back(p);
        return true;
    }
    bool close() {
        stack_.pop_back();
        return true;
    }
    JsonPath pathOfTop() const {
        JsonPath path;
        for (size_t i = 0; i + 1 < stack_.size(); ++i) {
            for (const auto& [name, value] : stack_[i]->items()) {
                if (&value == stack_[i + 1]) path.push_back(name);
            }
        }
        return path;
    }

    std::vector<Json*> stack_;  // open objects and arrays; an open one is the last element of its
                                // parent, so it stays put
    Json* slot_ = nullptr;
};

std::string lineAndColumn(std::string_view text, size_t byte) {
    const std::string_view before = text.substr(0, std::min(byte ? byte - 1 : 0, text.size()));
    const size_t line_start = before.rfind('\n');
    const size_t column =
        before.size() - (line_start == std::string_view::npos ? 0 : line_start + 1);
    return "line " + std::to_string(1 + std::count(before.begin(), before.end(), '\n')) +
           ", column " + std::to_string(1 + column);
}

bool matches(const Json& schema_document, const Json& value) {
    valijson::Schema schema;
    valijson::SchemaParser parser;
    parser.populateSchema(valijson::adapters::NlohmannJsonAdapter(schema_document), schema);
    return valijson::Validator().validate(schema, valijson::adapters::NlohmannJsonAdapter(value),
                                          nullptr);
}

// The schemas within `schema` that speak about `value`: itself, references, and the branches that
// apply. Conditions must not refer to definitions.
void collectSchemas(const Json& root, const Json& schema, const Json& value,
                    std::vector<const Json*>& found) {
    if (!schema.is_object()) return;
    found.push_back(&schema);
    if (const auto ref = schema.find("$ref"); ref != schema.end()) {
        collectSchemas(root, root.at(Json::json_pointer(ref->get<std::string>().substr(1))), value,
                       found);
    }
    for (const char* key : {"allOf", "oneOf", "anyOf"}) {
        if (!schema.contains(key)) continue;
        for (const Json& branch : schema[key]) collectSchemas(root, branch, value, found);
    }
    if (schema.contains("then") && matches(schema["if"], value))
        collectSchemas(root, schema["then"], value, found);
}

// The schemas that speak about what stands at `path` in `document`.
std::vector<const Json*> schemasAt(const Json& root, const JsonPath& path, const Json& document) {
    std::vector<const Json*> schemas;
    const Json* value = &document;
    collectSchemas(root, root, *value, schemas);
    for (const std::string& step : path) {
        value = value->is_array() ? &value->at(std::stoul(step)) : &value->at(step);
        std::vector<const Json*> next;
        for (const Json* schema : schemas) {
            const auto properties = schema->find("properties");
            if (properties != schema->end() && properties->contains(step)) {
                collectSchemas(root, (*properties)[step], *value, next);
            } else if (schema->contains("additionalProperties")) {
                collectSchemas(root, (*schema)["additionalProperties"], *value, next);
            }
            if (schema->contains("items")) collectSchemas(root, (*schema)["items"], *value, next);
        }
        schemas = std::move(next);
    }
    return schemas;
}

// The values that the schemas allow, as text; empty if they list none.
std::string allowedValues(const std::vector<const Json*>& schemas) {
    std::string list;
    for (const Json* schema : schemas) {
        if (!schema->contains("enum")) continue;
        for (const Json& value : (*schema)["enum"])
            list += (list.empty() ? "" : ", ") + value.dump();
    }
    return list;
}

// The keys that the schemas name, where one that knows no others names all.
std::vector<std::string> knownKeys(const std::vector<const Json*>& schemas) {
    std::vector<std::string> keys;
    for (const Json* schema : schemas) {
        if (!schema->contains("properties")) continue;
        for (const auto& [key, unused] : (*schema)["properties"].items()) {
            const bool is_refused =
                std::any_of(schemas.begin(), schemas.end(), [&key = key](const Json* other) {
                    return other->value("additionalProperties", Json()) == false &&
                           !(other->contains("properties") && (*other)["properties"].contains(key));
                });
            if (!is_refused) keys.push_back(key);
        }
    }
    return keys;
}

const Json* valueAt(const Json& root, const JsonPath& path) {
    const Json* value = &root;
    for (const std::string& step : path) {
        value = value->is_array() ? &value->at(std::stoul(step)) : &value->at(step);
    }
    return value;
}

// valijson's "[assets]", "[0]" as keys and indices.
JsonPath stepsOf(const std::vector<std::string>& context) {
    JsonPath path;
    for (size_t i = 1; i < context.size(); ++i)
        path.push_back(context[i].substr(1, context[i].size() - 2));
    return path;
}

}  // namespace

Json parseJson(std::string_view text, const std::string& where) {
    DocumentBuilder builder;
    if (!Json::sax_parse(text.begin(), text.end(), &builder)) {
        const std::string place =
            builder.problem_byte ? ": " + lineAndColumn(text, builder.problem_byte) : "";
        throw Error(ErrorCode::kParse, where + place,
                    "not valid JSON: " + oneLine(builder.problem, 200));
    }
    return std::move(builder.root);
}

std::string jsonPointer(const JsonPath& path) {
    std::string pointer;
    for (const std::string& step : path) {
        pointer += '/';
        for (char c : step) pointer += c == '~' ? "~0" : c == '/' ? "~1" : std::string(1, c);
    }
    return pointer.empty() ? "/" : oneLine(pointer, 300);
}

std::string gltfPath(const JsonPath& path) {
    std::string text;
    for (const std::string& step : path) {
        const bool is_index = !step.empty() && std::all_of(step.begin(), step.end(), [](char c) {
            return c >= '0' && c <= '9';
        });
        text += is_index ? "[" + step + "]" : (text.empty() ? "" : ".") + step;
    }
    return text.empty() ? "root" : oneLine(text, 300);
}

std::string oneLine(std::string_view text, size_t max_length) {
    std::string line;
    for (char c : text.substr(0, max_length)) line += uint8_t(c) < 0x20 || c == 0x7f ? ' ' : c;
    if (text.size() <= max_length) return line;
    while (!line.empty() && (line.back() & 0xc0) == 0x80)
        line.pop_back();  // no half UTF-8 characters
    if (!line.empty() && (line.back() & 0xc0) == 0xc0) line.pop_back();
    return line + "...";
}

std::string inQuotes(std::string_view text) {
    std::string result(1, '"');
    result += oneLine(text);
    result += '"';
    return result;
}

std::string nameHint(const std::string& name, const std::vector<std::string>& known) {
    const std::string nearest = nearestName(name, known);
    if (!nearest.empty()) return "; did you mean " + inQuotes(nearest) + "?";
    // Alternatives of a schema have keys in common.
    std::vector<std::string> names;
    for (const std::string& k : known)
        if (std::find(names.begin(), names.end(), k) == names.end()) names.push_back(k);
    constexpr size_t kFew = 16;
    if (names.empty() || names.size() > kFew) return "";
    std::string list = "; known: ";
    for (size_t i = 0; i < names.size(); ++i)
        list += (i == 0 ? "" : i + 1 == names.size() ? " and " : ", ") + inQuotes(names[i]);
    return list;
}

struct JsonSchema::Impl {
    Json document;
    valijson::Schema schema;
};

JsonSchema::JsonSchema(const char* schema_text, const std::string& definition)
    : impl_(std::make_unique<Impl>()) {
    impl_->document = Json::parse(schema_text);
    if (!definition.empty()) {
        const Json definitions = impl_->document["definitions"];
        impl_->document = {{"$ref", "#/definitions/" + definition}, {"definitions", definitions}};
    }
    valijson::SchemaParser parser;
    parser.populateSchema(valijson::adapters::NlohmannJsonAdapter(impl_->document), impl_->schema);
}

JsonSchema::~JsonSchema() = default;

std::optional<JsonSchema::Problem> JsonSchema::firstProblem(const Json& value) const {
    valijson::Validator validator;
    valijson::ValidationResults results;
    const valijson::adapters::NlohmannJsonAdapter target(value);
    if (validator.validate(impl_->schema, target, nullptr))
        return std::nullopt;  // the common case without bookkeeping
    validator.validate(impl_->schema, target, &results);
    valijson::ValidationResults::Error error;
    if (!results.popError(error)) return Problem{{}, "does not match the schema"};

    // The first error is the innermost. valijson's words, made clearer where they are not.
    Problem problem{stepsOf(error.context), error.description};
    const std::string& text = error.description;
    const size_t quote = text.rfind(": '");
    if (text.find("could not be validated using 'properties'") != std::string::npos &&
        quote != std::string::npos) {
        const std::string key = text.substr(quote + 3, text.rfind('\'') - quote - 3);
        problem.message = "unknown key " + inQuotes(key) +
                          nameHint(key, knownKeys(schemasAt(impl_->document, problem.path, value)));
        return problem;
    }
    const Json& culprit = *valueAt(value, problem.path);
    if (problem.message.ends_with('.')) problem.message.pop_back();
    const bool is_type = text.find("'type' constraint") != std::string::npos;
    if (is_type) problem.message = "wrong type";
    if (culprit.is_primitive()) {
        problem.message += ", got " + oneLine(culprit.dump(-1, ' ', true), 60);
    } else if (is_type) {
        problem.message += std::string(", got an ") + culprit.type_name();
    }
    if (const std::string allowed = allowedValues(schemasAt(impl_->document, problem.path, value));
        !allowed.empty()) {
        problem.message = oneLine(culprit.dump(-1, ' ', true), 60) + " is none of " + allowed;
    }
    return problem;
}

}  // namespace stipple
