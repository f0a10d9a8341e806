// SPDX-License-Identifier: Apache-2.0
// Wavefront OBJ files. why: the packaged reader (tinyobjloader, which reads our MTL files) loses
// the number of the line that is wrong, the points, and the colours of vertices where some lack
// them.
#include <core/image.h>
#include <scenegraph/io/json.h>
#include <scenegraph/io/model.h>
#include <scenegraph/io/obj_material.h>
#include <scenegraph/io/point_discs.h>
#include <scenegraph/io/polygon.h>

#include <array>
#include <charconv>
#include <optional>
#include <unordered_map>

namespace stipple {

namespace {

constexpr uint32_t kAbsent = 0xffffffffu;

struct Corner {
    uint32_t position, uv, normal;  // kAbsent: none
    bool operator==(const Corner&) const = default;
};

struct CornerHash {
    size_t operator()(const Corner& c) const {
        uint64_t h = c.position * 0x9e3779b97f4a7c15ull;
        h = (h ^ (h >> 29) ^ c.uv) * 0xbf58476d1ce4e5b9ull;
        h = (h ^ (h >> 32) ^ c.normal) * 0x94d049bb133111ebull;
        return size_t(h ^ (h >> 31));
    }
};

struct ObjContents {
    std::vector<Vec3> positions, colors, normals;  // colors: one a position, linear; or none
    std::vector<Vec2> uvs;
    std::vector<Corner> corners;  // of all faces, one after the other
    struct Face {
        uint32_t size;
        uint16_t material;
    };
    std::vector<Face> faces;
    ObjMaterials materials;
};

class ObjParser {
public:
    ObjParser(std::string_view text, const std::filesystem::path& folder, Scene& scene,
              LoadContext& context, const std::string& where)
        : text_(text), folder_(folder), scene_(scene), context_(context), where_(where) {
        Material material;
        material.name = "default";
        material.double_sided = true;
        out_.materials.materials.push_back(std::move(material));
    }

    ObjContents parse() {
        for (size_t at = 0; at < text_.size();) {
            const size_t end = std::min(text_.find_first_of("\r\n", at), text_.size());
            line_ = text_.substr(at, end - at);
            ++line_number_;
            if (line_number_ % 65536 == 0) context_.throwIfCancelled();
            at = end + (text_.substr(end).starts_with("\r\n") ? 2 : 1);
            // A backslash at the end continues the line: rare, so it costs a copy only then.
            if (line_.ends_with('\\')) {
                joined_ += std::string(line_.substr(0, line_.size() - 1)) + " ";
                continue;
            }
            if (!joined_.empty()) {
                joined_ += line_;
                line_ = joined_;
                parseLine();
                joined_.clear();
            } else {
                parseLine();
            }
        }
        if (!joined_.empty()) {
            line_ = joined_;
            parseLine();
        }
        checkLargest(largest_[0], out_.positions.size(), "v");
        checkLargest(largest_[1], out_.uvs.size(), "vt");
        checkLargest(largest_[2], out_.normals.size(), "vn");
        if (out_.colors.size() != out_.positions.size()) out_.colors.clear();
        return std::move(out_);
    }

private:
    [[noreturn]] void fail(ErrorCode code, const std::string& message) const {
        throw Error(code, place(), message);
    }
    std::string place() const { return where_ + ": line " + std::to_string(line_number_); }

    std::string_view nextWord() {
        const size_t begin = std::min(line_.find_first_not_of(" \t"), line_.size());
        const size_t end = std::min(line_.find_first_of(" \t", begin), line_.size());
        const std::string_view word = line_.substr(begin, end - begin);
        line_.remove_prefix(end);
        return word;
    }

    std::optional<float> nextNumber() {
        std::string_view word = nextWord();
        if (word.empty()) return std::nullopt;
        if (word[0] == '+') word.remove_prefix(1);
        double value = 0.0;
        const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
        const bool is_range = error == std::errc::result_out_of_range;
        if ((error != std::errc() && !is_range) || end != word.data() + word.size())
            fail(ErrorCode::kParse, inQuotes(word) + " is no number");
        if (is_range) value = std::strtod(std::string(word).c_str(), nullptr);  // 0 or infinite
        if (!(std::abs(value) <= 1e15))                                         // areas stay finite
            fail(ErrorCode::kInvalidScene, inQuotes(word) + " is beyond 1e15 or not finite");
        return float(value);
    }
    float requiredNumber() {
        const auto value = nextNumber();
        if (!value) fail(ErrorCode::kParse, "a number is missing");
        return *value;
    }

    void parseLine() {
        const std::string_view key = nextWord();
        if (key == "v") {
            parsePosition();
        } else if (key == "vt") {
            const float u = requiredNumber();
            out_.uvs.emplace_back(u, 1.0f - nextNumber().value_or(0.0f));  // v points up
        } else if (key == "vn") {
            const float x = requiredNumber(), y = requiredNumber(), z = requiredNumber();
            out_.normals.emplace_back(x, y, z);
        } else if (key == "f") {
            parseFace();
        } else if (key == "usemtl") {
            useMaterial(rest());
        } else if (key == "mtllib") {
            loadMaterials(rest());
        } else if (key == "l" || key == "curv" || key == "curv2" || key == "surf") {
            context_.warnOnce(where_, "lines, curves and free-form surfaces are skipped");
        } else if (key == "p") {
            context_.warnOnce(where_, "points beside faces are skipped");
        }
    }

    std::string rest() const {
        const size_t begin = std::min(line_.find_first_not_of(" \t"), line_.size());
        const size_t end = line_.find_last_not_of(" \t");
        return begin < line_.size() ? std::string(line_.substr(begin, end - begin + 1)) : "";
    }

    void parsePosition() {
        const float x = requiredNumber(), y = requiredNumber(), z = requiredNumber();
        // x y z [w], or x y z r g b.
        std::array<float, 3> more{};
        int n = 0;
        while (n < 3) {
            const auto value = nextNumber();
            if (!value) break;
            more[size_t(n++)] = *value;
        }
        if (out_.positions.size() >= kAbsent - 1)
            fail(ErrorCode::kUnsupported, "too many vertices");
        if (n == 3 && out_.colors.size() == out_.positions.size()) {
            const auto linear = [](float c) { return linearFromSrgb(std::clamp(c, 0.0f, 1.0f)); };
            out_.colors.emplace_back(linear(more[0]), linear(more[1]), linear(more[2]));
        }
        out_.positions.emplace_back(x, y, z);
    }

    // One index of "v/vt/vn", 1-based, or counted back from the last if negative. Larger ones than
    // there are so far may follow: they are looked at in the end.
    uint32_t parseIndex(std::string_view text, size_t n_so_far, int kind) {
        if (text.empty() && kind > 0) return kAbsent;
        int64_t index = 0;
        const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), index);
        if (error != std::errc() || end != text.data() + text.size())
            fail(ErrorCode::kParse, inQuotes(text) + " is no index");
        if (index < 0) index += int64_t(n_so_far) + 1;
        if (index <= 0 || index >= int64_t(kAbsent)) {
            fail(ErrorCode::kInvalidScene, "index " + oneLine(text, 30) + ", but there are " +
                                               std::to_string(n_so_far) + " vertices so far");
        }
        Largest& largest = largest_[size_t(kind)];
        if (uint64_t(index) > largest.index) largest = {uint64_t(index), line_number_};
        return uint32_t(index - 1);
    }

    void parseFace() {
        const size_t first = out_.corners.size();
        for (std::string_view word = nextWord(); !word.empty(); word = nextWord()) {
            std::array<std::string_view, 3> parts;
            for (std::string_view& part : parts) {
                const size_t slash = std::min(word.find('/'), word.size());
                part = word.substr(0, slash);
                word.remove_prefix(std::min(slash + 1, word.size()));
            }
            out_.corners.push_back({parseIndex(parts[0], out_.positions.size(), 0),
                                    parseIndex(parts[1], out_.uvs.size(), 1),
                                    parseIndex(parts[2], out_.normals.size(), 2)});
        }
        const size_t n = out_.corners.size() - first;
        if (n < 3) return out_.corners.resize(first);
        out_.faces.push_back({uint32_t(n), material_});
    }

    void useMaterial(const std::string& name) {
        const auto it = out_.materials.by_name.find(name);
        material_ = it == out_.materials.by_name.end() ? uint16_t(0) : it->second;
        if (material_ == 0 && has_library_)
            context_.warnOnce(where_, "material " + inQuotes(name) + " is in no MTL file");
    }

    // The line is one name, which may hold spaces, or several.
    void loadMaterials(const std::string& names) {
        const auto tryLoad = [&](const std::string& name) {
            try {
                readMtl(folder_, name, scene_, context_, place(), out_.materials);
                return true;
            } catch (const Error& error) {
                if (error.code() != ErrorCode::kFileNotFound) throw;
                return false;
            }
        };
        bool is_loaded = tryLoad(names);
        if (!is_loaded && names.find(' ') != std::string::npos) {
            std::string_view left = names;
            std::swap(left, line_);
            for (std::string_view word = nextWord(); !word.empty(); word = nextWord())
                is_loaded |= tryLoad(std::string(word));
        }
        has_library_ |= is_loaded;
        if (!is_loaded) {
            context_.warnOnce(where_, "MTL file " + inQuotes(names) +
                                          " cannot be opened; drawn without its materials");
        }
    }

    struct Largest {
        uint64_t index = 0;  // 1-based
        size_t line = 0;
    };
    void checkLargest(const Largest& largest, size_t count, const char* what) const {
        if (largest.index <= count) return;
        throw Error(ErrorCode::kInvalidScene, where_ + ": line " + std::to_string(largest.line),
                    "index " + std::to_string(largest.index) + ", but there are " +
                        std::to_string(count) + " lines \"" + what + "\"");
    }

    std::string_view text_, line_;
    std::string joined_;
    size_t line_number_ = 0;
    const std::filesystem::path& folder_;
    Scene& scene_;
    LoadContext& context_;
    const std::string& where_;
    ObjContents out_;
    uint16_t material_ = 0;
    bool has_library_ = false;
    std::array<Largest, 3> largest_;
};

// One vertex for each combination of position, uv and normal.
void addFaces(const ObjContents& contents, Mesh& mesh) {
    const bool any_uvs = !contents.uvs.empty(), any_normals = !contents.normals.empty();
    std::unordered_map<Corner, uint32_t, CornerHash> vertices;
    vertices.reserve(contents.positions.size() * 2);
    std::vector<uint32_t> polygon;
    size_t at = 0;
    for (const auto& face : contents.faces) {
        polygon.clear();
        for (uint32_t k = 0; k < face.size; ++k) {
            const Corner& c = contents.corners[at++];
            const auto [it, is_new] = vertices.emplace(c, uint32_t(mesh.positions.size()));
            polygon.push_back(it->second);
            if (!is_new) continue;
            mesh.positions.push_back(contents.positions[c.position]);
            if (!contents.colors.empty())
                mesh.colors.emplace_back(contents.colors[c.position], 1.0f);
            if (any_uvs) mesh.uvs.push_back(c.uv == kAbsent ? Vec2(0.0f) : contents.uvs[c.uv]);
            if (any_normals) {
                // A null vector is flat shading.
                const DVec3 n(c.normal == kAbsent ? Vec3(0.0f) : contents.normals[c.normal]);
                const double length = glm::length(n);
                mesh.normals.push_back(length > 1e-12 ? Vec3(n / length) : Vec3(0.0f));
            }
        }
        triangulatePolygon(mesh.positions, polygon, mesh.triangles);
        mesh.triangle_material.resize(mesh.triangles.size(), face.material);
    }
}

}  // namespace

ChildRef loadObj(const std::filesystem::path& path, const std::string& name, Scene& scene,
                 LoadContext& context) {
    constexpr double kBytesPerFileByte = 12.0;  // "f 1 2 3": contents, vertices and triangle
    const std::string where = oneLine(name, 300);
    const std::string text = readFile(path, context.budget, where);
    context.budget.take(double(text.size()) * kBytesPerFileByte, where, "its vertices and faces");
    const std::filesystem::path folder = folderOf(path.string());
    ObjContents contents = ObjParser(text, folder, scene, context, where).parse();

    if (contents.positions.empty())
        throw Error(ErrorCode::kParse, where, "has no vertices: not an OBJ file");

    Mesh mesh;
    mesh.name = oneLine(path.stem().string());
    if (!contents.faces.empty()) {
        addFaces(contents, mesh);
    } else {
        const bool has_normals = contents.normals.size() == contents.positions.size();
        const PointDiscs discs =
            makePointDiscs(contents.positions, has_normals ? contents.normals : std::vector<Vec3>(),
                           context, where);
        mesh.is_cloud = true;
        mesh.positions = discs.corners;
        mesh.triangles = discs.triangles;
        for (const Vec3& color : perCorner(discs, contents.colors))
            mesh.colors.emplace_back(color, 1.0f);
        mesh.triangle_material.assign(mesh.triangles.size(), 0);
    }
    std::vector<Material>& materials = contents.materials.materials;
    if (!mesh.colors.empty()) materials[0].base_color = Vec3(1.0f);
    return addModel(scene, std::move(mesh), std::move(materials), where);
}

}  // namespace stipple
