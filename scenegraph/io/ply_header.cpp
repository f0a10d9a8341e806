// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/ply_header.h>

#include <scenegraph/io/json.h>

#include <array>
#include <charconv>
#include <optional>

namespace stipple {

namespace {

constexpr size_t kMostHeaderBytes = 1 << 20, kMostProperties = 1000;

std::optional<PlyType> typeOf(std::string_view name) {
    constexpr std::array<std::pair<std::string_view, PlyType>, 16> kNames = {{
        {"char", PlyType::kInt8},
        {"int8", PlyType::kInt8},
        {"uchar", PlyType::kUint8},
        {"uint8", PlyType::kUint8},
        {"short", PlyType::kInt16},
        {"int16", PlyType::kInt16},
        {"ushort", PlyType::kUint16},
        {"uint16", PlyType::kUint16},
        {"int", PlyType::kInt32},
        {"int32", PlyType::kInt32},
        {"uint", PlyType::kUint32},
        {"uint32", PlyType::kUint32},
        {"float", PlyType::kFloat32},
        {"float32", PlyType::kFloat32},
        {"double", PlyType::kFloat64},
        {"float64", PlyType::kFloat64},
    }};
    for (const auto& [text, type] : kNames) {
        if (text == name) return type;
    }
    return std::nullopt;
}

std::vector<std::string_view> words(std::string_view line) {
    std::vector<std::string_view> result;
    for (size_t at = 0; (at = line.find_first_not_of(" \t", at)) != std::string_view::npos;) {
        const size_t end = std::min(line.find_first_of(" \t", at), line.size());
        result.push_back(line.substr(at, end - at));
        at = end;
    }
    return result;
}

class HeaderParser {
public:
    HeaderParser(std::string_view bytes, const std::string& where) : bytes_(bytes), where_(where) {
        const size_t end = bytes.substr(0, kMostHeaderBytes).find_first_of("\r\n");
        if (end == std::string_view::npos || bytes.substr(0, end) != "ply")
            throw Error(ErrorCode::kParse, where, "does not start with a line \"ply\"");
        line_end_ = bytes.substr(end, bytes.substr(end).starts_with("\r\n") ? 2 : 1);
        header_.size = end + line_end_.size();
        header_.lines = 1;
    }

    PlyHeader parse() {
        bool has_format = false;
        for (;;) {
            const size_t end = bytes_.substr(0, kMostHeaderBytes).find(line_end_, header_.size);
            if (end == std::string_view::npos) fail("the header does not end");
            const std::string_view line = bytes_.substr(header_.size, end - header_.size);
            header_.size = end + line_end_.size();
            ++header_.lines;
            const auto w = words(line);
            if (w.empty() || w[0] == "obj_info") continue;
            if (w[0] == "end_header") break;
            if (w[0] == "comment") {
                if (w.size() == 3 && w[1] == "TextureFile") header_.texture_file = w[2];
            } else if (w[0] == "format") {
                readFormat(w);
                has_format = true;
            } else if (w[0] == "element") {
                readElement(w);
            } else if (w[0] == "property") {
                readProperty(w);
            } else {
                fail(inQuotes(w[0]) + " is no line of a header");
            }
        }
        if (!has_format) fail("the header has no format");
        return std::move(header_);
    }

private:
    [[noreturn]] void fail(const std::string& message) const {
        throw Error(ErrorCode::kParse, where_ + ": line " + std::to_string(header_.lines), message);
    }

    void readFormat(const std::vector<std::string_view>& w) {
        if (w.size() < 3) fail("a format has a name and a version");
        if (w[2] != "1.0") {
            throw Error(ErrorCode::kUnsupported, where_,
                        "PLY of version " + oneLine(w[2], 20) + ", not 1.0");
        }
        if (w[1] == "ascii") {
            header_.encoding = PlyEncoding::kAscii;
        } else if (w[1] == "binary_little_endian") {
            header_.encoding = PlyEncoding::kLittleEndian;
        } else if (w[1] == "binary_big_endian") {
            header_.encoding = PlyEncoding::kBigEndian;
        } else {
            fail("unknown format " + inQuotes(w[1]));
        }
    }

    void readElement(const std::vector<std::string_view>& w) {
        PlyElement element;
        if (w.size() < 3) fail("an element has a name and a count");
        element.name = w[1];
        const auto [end, error] =
            std::from_chars(w[2].data(), w[2].data() + w[2].size(), element.count);
        if (error != std::errc() || end != w[2].data() + w[2].size())
            fail(inQuotes(w[2]) + " is no count");
        header_.elements.push_back(std::move(element));
    }

    void readProperty(const std::vector<std::string_view>& w) {
        if (header_.elements.empty()) fail("a property without an element");
        PlyProperty property;
        property.is_list = w.size() >= 2 && w[1] == "list";
        if (w.size() < (property.is_list ? 5u : 3u)) fail("a property has a type and a name");
        const auto type = [&](std::string_view name) {
            const auto result = typeOf(name);
            if (!result) fail("unknown type " + inQuotes(name));
            return *result;
        };
        if (property.is_list) property.count_type = type(w[2]);
        property.type = type(w[property.is_list ? 3 : 1]);
        property.name = w[property.is_list ? 4 : 2];
        auto& properties = header_.elements.back().properties;
        properties.push_back(std::move(property));
        if (properties.size() > kMostProperties) fail("more than 1000 properties");
    }

    std::string_view bytes_;
    const std::string& where_;
    std::string_view line_end_;
    PlyHeader header_;
};

}  // namespace

size_t plyTypeSize(PlyType type) {
    constexpr std::array<size_t, 8> kSizes = {1, 1, 2, 2, 4, 4, 4, 8};
    return kSizes[size_t(type)];
}

PlyHeader parsePlyHeader(std::string_view bytes, const std::string& where) {
    return HeaderParser(bytes, where).parse();
}

}  // namespace stipple
