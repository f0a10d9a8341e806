// SPDX-License-Identifier: Apache-2.0
#include <core/error.h>
#include <raster/gl_renderer.h>

#include <algorithm>
#include <tuple>

namespace stipple {

namespace {

// A target takes 8 bytes a subpixel; larger views are drawn in tiles, at the price of shading again
// what crosses their borders.
constexpr int64_t kMaxTileSubpixels = int64_t(1) << 26;

// The number is flat: it comes from the triangle's last corner, which is vertex t for triangle t
// (see makeMeshArrays).
constexpr const char* kVertexShader = R"(
layout(location = 0) in vec3 p_object;
layout(location = 0) uniform vec4 clip_rows[4];
layout(location = 4) uniform uint first_number;
layout(location = 0) flat out uint number;
#ifdef MASKED
layout(location = 1) in vec3 mask_in;
layout(location = 1) out vec3 mask;
#endif
void main() {
    vec4 p = vec4(p_object, 1.0);
    gl_Position = vec4(dot(clip_rows[0], p), dot(clip_rows[1], p),
                       dot(clip_rows[2], p), dot(clip_rows[3], p));
    number = first_number + uint(gl_VertexID);
#ifdef MASKED
    mask = mask_in;
#endif
}
)";

// The camera z is not written: it is read from the depth buffer, which saves a third of the
// traffic.
constexpr const char* kFragmentShader = R"(
layout(location = 0) flat in uint number;
layout(location = 0) out uint number_out;
#ifdef MASKED
layout(location = 1) in vec3 mask;                // u, v, vertex alpha
layout(location = 5) uniform vec2 alpha_cutoff;   // the material's alpha and cutoff
layout(binding = 0) uniform sampler2D alpha_map;
#endif
void main() {
#ifdef MASKED
    if (texture(alpha_map, mask.xy).r * mask.z * alpha_cutoff.x < alpha_cutoff.y) discard;
#endif
    number_out = number;
}
)";

GLuint makeProgram(const Gl& gl, bool masked) {
    const std::string head = masked ? "#version 450\n#define MASKED\n" : "#version 450\n";
    return gl.makeProgram(head + kVertexShader, head + kFragmentShader);
}

GLint wrapMode(Wrap wrap) {
    switch (wrap) {
        case Wrap::kMirror:
            return GL_MIRRORED_REPEAT;
        case Wrap::kClamp:
            return GL_CLAMP_TO_EDGE;
        default:
            return GL_REPEAT;
    }
}

template <class T>
void uploadBuffer(const Gl& gl, GLenum kind, const std::vector<T>& values) {
    GLuint buffer = 0;
    gl.GenBuffers(1, &buffer);
    gl.BindBuffer(kind, buffer);
    gl.BufferData(kind, GLsizeiptr(values.size() * sizeof(T)), values.data(), GL_STATIC_DRAW);
}

bool isDrawable(const RasterDraw& draw) {
    return isFinite(DVec3(draw.linear[0])) && isFinite(DVec3(draw.linear[1])) &&
           isFinite(DVec3(draw.linear[2])) && isFinite(DVec3(draw.translation));
}

// Whether a box lies beyond one of the six planes of the clip volume.
bool isOutside(const std::array<glm::dvec4, 4>& clip_rows, const Box3& box) {
    int outside[6] = {};
    for (int i = 0; i < 8; ++i) {
        const glm::dvec4 p(DVec3(box.corner(i)), 1.0);
        const double x = glm::dot(clip_rows[0], p), y = glm::dot(clip_rows[1], p),
                     z = glm::dot(clip_rows[2], p), w = glm::dot(clip_rows[3], p);
        const double inside[6] = {w + x, w - x, w + y, w - y, z, w - z};
        for (int k = 0; k < 6; ++k) outside[k] += inside[k] < 0.0;
    }
    return std::find(outside, outside + 6, 8) != outside + 6;
}

// A stretch of triangles of one draw with one state.
struct Piece {
    SurfaceState state;
    uint32_t first;
    uint32_t count;
};

std::vector<Piece> intersect(const RasterJob& job, const RasterDraw& draw,
                             const std::vector<MeshRun>& runs) {
    if (draw.range_begin > job.ranges.size() ||
        draw.range_count > job.ranges.size() - draw.range_begin) {
        throw Error(ErrorCode::kInvalidArgument, "rasterizer",
                    "a draw names ranges that are not there");
    }
    std::vector<Piece> pieces;
    bool one_state = true;
    for (uint32_t i = 0; i < draw.range_count; ++i) {
        const TriangleRange& range = job.ranges[draw.range_begin + i];
        const uint64_t end = uint64_t(range.first) + range.count;
        auto run =
            std::upper_bound(runs.begin(), runs.end(), range.first,
                             [](uint32_t first, const MeshRun& r) { return first < r.first; });
        if (run != runs.begin()) --run;
        for (; run != runs.end() && run->first < end; ++run) {
            const uint64_t first = std::max(range.first, run->first);
            const uint64_t last = std::min<uint64_t>(end, uint64_t(run->first) + run->count);
            if (run->state.hidden || first >= last) continue;
            if (!pieces.empty() && !(pieces.back().state == run->state)) one_state = false;
            pieces.push_back({run->state, uint32_t(first), uint32_t(last - first)});
        }
    }
    if (!one_state) {
        std::stable_sort(pieces.begin(), pieces.end(), [](const Piece& a, const Piece& b) {
            return std::tie(a.state.masked_material, a.state.double_sided) <
                   std::tie(b.state.masked_material, b.state.double_sided);
        });
    }
    return pieces;
}

// Depth buffer values to camera z, in place; 0 is where nothing was drawn. Infinity is added, not
// chosen: compilers vectorize this.
void decodePerspective(float* depth, size_t n, float scale, float offset) {
    for (size_t i = 0; i < n; ++i) {
        const float d = depth[i], nothing = d > 0.0f ? 0.0f : kInfinity;
        depth[i] = offset / (d - scale) + nothing;
    }
}

void decodeOrthographic(float* depth, size_t n, float far_z, float range) {
    for (size_t i = 0; i < n; ++i) {
        const float d = depth[i], nothing = d > 0.0f ? 0.0f : kInfinity;
        depth[i] = far_z - d * range + nothing;
    }
}

void fillEmpty(const View& view, int x, int y, int width, int height, RasterTarget& target) {
    for (int row = y; row < y + height; ++row) {
        const size_t begin = size_t(row) * view.subWidth() + x;
        std::fill_n(target.depth.begin() + begin, width, kInfinity);
        std::fill_n(target.number.begin() + begin, width, kNoNumber);
    }
}

}  // namespace

GlRenderer::GlRenderer(const Gl& gl, std::vector<RasterMesh> meshes,
                       const std::vector<Material>& materials, const std::vector<Texture>& textures)
    : gl_(gl),
      meshes_(std::move(meshes)),
      materials_(materials),
      textures_(textures),
      gpu_meshes_(meshes_.size()),
      mask_textures_(textures.size() + 1, 0) {
    // Only what masks are made of is looked at.
    texture_alpha_.resize(textures_.size());
    std::vector<bool> is_mask(textures_.size(), false);
    for (const Material& m : materials_) {
        if (m.alpha_mode != AlphaMode::kOpaque && m.base_texture != kNoTexture)
            is_mask[m.base_texture] = true;
    }
    for (size_t i = 0; i < textures_.size(); ++i) {
        if (is_mask[i]) texture_alpha_[i] = alphaRange(textures_[i]);
    }

    opaque_program_ = makeProgram(gl_, false);
    max_size_ = std::min(gl_.integer(GL_MAX_RENDERBUFFER_SIZE), gl_.integer(GL_MAX_VIEWPORT_DIMS));
    gl_.ClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
    gl_.Enable(GL_DEPTH_TEST);
    gl_.DepthFunc(GL_GREATER);
    gl_.PixelStorei(GL_UNPACK_ALIGNMENT, 1);
    gl_.check("start");
}

const GlRenderer::GpuMesh& GlRenderer::gpuMesh(uint32_t index) {
    if (index >= meshes_.size())
        throw Error(ErrorCode::kInvalidArgument, "rasterizer", "a draw names no mesh");
    std::optional<GpuMesh>& mesh = gpu_meshes_[index];
    if (mesh) return *mesh;
    MeshArrays arrays = makeMeshArrays(meshes_[index], materials_, texture_alpha_);
    GpuMesh made;
    gl_.GenVertexArrays(1, &made.vertex_array);
    gl_.BindVertexArray(made.vertex_array);
    uploadBuffer(gl_, GL_ARRAY_BUFFER, arrays.positions);
    gl_.EnableVertexAttribArray(0);
    gl_.VertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, 0, nullptr);
    if (!arrays.masks.empty()) {
        uploadBuffer(gl_, GL_ARRAY_BUFFER, arrays.masks);
        gl_.EnableVertexAttribArray(1);
        gl_.VertexAttribPointer(1, 3, GL_FLOAT, GL_FALSE, 0, nullptr);
    }
    uploadBuffer(gl_, GL_ELEMENT_ARRAY_BUFFER, arrays.triangles);
    gl_.check("uploading a mesh");
    made.runs = std::move(arrays.runs);
    made.bounds = arrays.bounds;
    mesh = std::move(made);
    return *mesh;
}

// Level 0 only: a mask means the same at any distance, as for rays. Averaged alpha, cut at the
// cutoff, makes leaves vanish or swell.
GLuint GlRenderer::maskTexture(int texture) {
    const bool none = texture == kNoTexture || textures_[texture].levels.empty();
    GLuint& name = mask_textures_[none ? textures_.size() : size_t(texture)];
    if (name) return name;
    Texture::Level opaque{1, 1, {255, 255, 255, 255}};
    const Texture::Level* level = &opaque;
    if (!none) {
        const std::vector<Texture::Level>& levels = textures_[texture].levels;
        const int max_size = gl_.integer(GL_MAX_TEXTURE_SIZE);
        const auto fitting = std::find_if(
            levels.begin(), levels.end() - 1,
            [&](const Texture::Level& l) { return l.width <= max_size && l.height <= max_size; });
        level = &*fitting;
    }
    std::vector<uint8_t> alpha(level->rgba.size() / 4);
    for (size_t i = 0; i < alpha.size(); ++i) alpha[i] = level->rgba[4 * i + 3];
    gl_.GenTextures(1, &name);
    gl_.BindTexture(GL_TEXTURE_2D, name);
    gl_.TexImage2D(GL_TEXTURE_2D, 0, GL_R8, level->width, level->height, 0, GL_RED,
                   GL_UNSIGNED_BYTE, alpha.data());
    const Texture plain;
    const Texture& sampling = none ? plain : textures_[texture];
    const GLint filter = sampling.nearest ? GL_NEAREST : GL_LINEAR;
    gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, filter);
    gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, filter);
    gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, wrapMode(sampling.wrap_u));
    gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, wrapMode(sampling.wrap_v));
    gl_.check("uploading a texture");
    return name;
}

// Binds a framebuffer of that size and clears it.
void GlRenderer::bindFramebuffer(int width, int height) {
    if (framebuffers_[0].width != width || framebuffers_[0].height != height) {
        std::swap(framebuffers_[0], framebuffers_[1]);
    }
    Framebuffer& f = framebuffers_[0];
    if (f.width != width || f.height != height) {
        gl_.DeleteFramebuffers(1, &f.framebuffer);
        gl_.DeleteRenderbuffers(1, &f.number);
        gl_.DeleteRenderbuffers(1, &f.depth);
        f = {};
        const auto attach = [&](GLuint& buffer, GLenum format, GLenum attachment) {
            gl_.GenRenderbuffers(1, &buffer);
            gl_.BindRenderbuffer(GL_RENDERBUFFER, buffer);
            gl_.RenderbufferStorage(GL_RENDERBUFFER, format, width, height);
            gl_.FramebufferRenderbuffer(GL_FRAMEBUFFER, attachment, GL_RENDERBUFFER, buffer);
        };
        gl_.GenFramebuffers(1, &f.framebuffer);
        gl_.BindFramebuffer(GL_FRAMEBUFFER, f.framebuffer);
        attach(f.number, GL_R32UI, GL_COLOR_ATTACHMENT0);
        attach(f.depth, GL_DEPTH_COMPONENT32F, GL_DEPTH_ATTACHMENT);
        gl_.check("making a target of " + std::to_string(width) + "x" + std::to_string(height));
        if (gl_.CheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) {
            throw Error(ErrorCode::kInternal, "rasterizer", "the GL refuses the target's formats");
        }
        f.width = width;
        f.height = height;
    }
    gl_.BindFramebuffer(GL_FRAMEBUFFER, f.framebuffer);
    gl_.Viewport(0, 0, width, height);
    const float far_depth = 0.0f;
    gl_.ClearBufferuiv(GL_COLOR, 0, &kNoNumber);
    gl_.ClearBufferfv(GL_DEPTH, 0, &far_depth);
}

// Perspective: depth is about near_z / z, as precise as z itself at any distance. Orthographic:
// linear over the z of what is drawn, since floats spread over all of [near_z, far_z] would be
// coarse. Either way depth is 1 at the near end and 0 at the far one.
GlRenderer::DepthCoding GlRenderer::depthCoding(const View& view, const RasterJob& job) {
    double near_z = view.near_z, far_z = view.far_z;
    if (!view.orthographic) {
        near_z = std::max(near_z, 1e-6);
        if (std::isinf(far_z)) return {0.0, near_z};
        return {-near_z / (far_z - near_z), near_z * far_z / (far_z - near_z)};
    }
    double low = kInfinity, high = -kInfinity;
    for (const RasterDraw& draw : job.draws) {
        const GpuMesh& mesh = gpuMesh(draw.mesh);
        if (!isDrawable(draw) || mesh.bounds.isEmpty()) continue;
        const DBox3 box =
            transformBox(Affine{DMat3(draw.linear), DVec3(draw.translation)}, mesh.bounds);
        low = std::min(low, box.min.z);
        high = std::max(high, box.max.z);
    }
    if (!(low <= high)) return {};
    // Room for rounding, and so that what lies at the far end does not get the depth of nothing.
    const double margin =
        1e-3 * (high - low) + 1e-5 * std::max(std::abs(low), std::abs(high)) + 1e-6;
    near_z = std::max(near_z, low - margin);
    far_z = std::max(std::min(far_z, high + margin), near_z + margin);
    return {-1.0 / (far_z - near_z), far_z / (far_z - near_z)};
}

// Fills commands_ with what may show in the tile, sorted by state.
void GlRenderer::collect(const View& view, const DepthCoding& coding, const Tile& tile,
                         const RasterJob& job) {
    commands_.clear();
    counts_.clear();
    offsets_.clear();
    // Camera y points down and so does the framebuffer's, so that row 0 is read first.
    const double scale_x = 2.0 * view.focal / tile.width, scale_y = 2.0 * view.focal / tile.height;
    const double center_x = 2.0 * (view.center_x - tile.x) / tile.width - 1.0;
    const double center_y = 2.0 * (view.center_y - tile.y) / tile.height - 1.0;
    const glm::dvec4 one(0.0, 0.0, 0.0, 1.0);
    for (const RasterDraw& draw : job.draws) {
        const GpuMesh& mesh = gpuMesh(draw.mesh);
        if (!isDrawable(draw) || mesh.bounds.isEmpty()) continue;
        const auto cameraRow = [&](int i) {
            return glm::dvec4(draw.linear[0][i], draw.linear[1][i], draw.linear[2][i],
                              draw.translation[i]);
        };
        const glm::dvec4 z = cameraRow(2), w = view.orthographic ? one : z;
        const ClipRows rows = {scale_x * cameraRow(0) + center_x * w,
                               scale_y * cameraRow(1) + center_y * w,
                               coding.scale * z + coding.offset * one, w};
        if (isOutside(rows, mesh.bounds)) continue;
        Command command;
        command.mesh = draw.mesh;
        command.first_number = draw.first_number;
        command.mirrored = glm::determinant(DMat3(draw.linear)) < 0.0;
        for (int i = 0; i < 4; ++i) command.clip_rows[i] = Vec4(rows[i]);
        addDraw(job, draw, mesh, command);
    }
    const auto key = [](const Command& c) {
        return std::make_tuple(c.state.masked_material, c.state.double_sided,
                               !c.state.double_sided && c.mirrored, c.mesh);
    };
    const auto less = [&](const Command& a, const Command& b) { return key(a) < key(b); };
    if (!std::is_sorted(commands_.begin(), commands_.end(), less)) {
        std::stable_sort(commands_.begin(), commands_.end(), less);
    }
}

// Adds one command for each state that the draw's ranges meet.
void GlRenderer::addDraw(const RasterJob& job, const RasterDraw& draw, const GpuMesh& mesh,
                         Command command) {
    uint64_t previous_end = ~uint64_t(0);
    bool open = false;
    for (const Piece& piece : intersect(job, draw, mesh.runs)) {
        if (!open || !(command.state == piece.state)) {
            if (open) commands_.push_back(command);
            command.state = piece.state;
            command.begin = counts_.size();
            previous_end = ~uint64_t(0);
            open = true;
        }
        if (piece.first == previous_end) {
            counts_.back() += GLsizei(3 * piece.count);
        } else {
            counts_.push_back(GLsizei(3 * piece.count));
            offsets_.push_back(reinterpret_cast<const void*>(sizeof(UVec3) * size_t(piece.first)));
        }
        previous_end = uint64_t(piece.first) + piece.count;
        command.end = counts_.size();
    }
    if (open) commands_.push_back(command);
}

void GlRenderer::drawCommands() {
    const Command* last = nullptr;
    for (const Command& c : commands_) {
        const bool masked = c.state.masked_material >= 0;
        if (!last || c.state.masked_material != last->state.masked_material ||
            (masked && c.mesh != last->mesh)) {
            if (!masked) {
                gl_.UseProgram(opaque_program_);
            } else {
                if (!masked_program_) masked_program_ = makeProgram(gl_, true);
                const Material& material = materials_[c.state.masked_material];
                const bool has_uvs = meshes_[c.mesh].uvs && !meshes_[c.mesh].uvs->empty();
                gl_.UseProgram(masked_program_);
                gl_.Uniform2f(5, material.alpha, alphaCutoff(material));
                gl_.BindTexture(GL_TEXTURE_2D,
                                maskTexture(has_uvs ? material.base_texture : kNoTexture));
            }
        }
        if (!last || c.state.double_sided != last->state.double_sided) {
            if (c.state.double_sided)
                gl_.Disable(GL_CULL_FACE);
            else
                gl_.Enable(GL_CULL_FACE);
        }
        // Seen with y down, what is counter-clockwise from the front is clockwise; a mirrored
        // instance turns that round again.
        if (!last || c.mirrored != last->mirrored) gl_.FrontFace(c.mirrored ? GL_CCW : GL_CW);
        if (!last || c.mesh != last->mesh) gl_.BindVertexArray(gpu_meshes_[c.mesh]->vertex_array);
        gl_.Uniform4fv(0, 4, &c.clip_rows[0].x);
        gl_.Uniform1ui(4, c.first_number);
        gl_.MultiDrawElements(GL_TRIANGLES, counts_.data() + c.begin, GL_UNSIGNED_INT,
                              offsets_.data() + c.begin, GLsizei(c.end - c.begin));
        last = &c;
    }
}

void GlRenderer::readBack(const View& view, const DepthCoding& coding, const Tile& tile,
                          RasterTarget& target) {
    // Decoded while a few rows are in the cache.
    constexpr int kRows = 32;
    const int stride = view.subWidth();
    gl_.PixelStorei(GL_PACK_ROW_LENGTH, stride);
    const size_t corner = size_t(tile.y) * stride + tile.x;
    gl_.ReadPixels(0, 0, tile.width, tile.height, GL_RED_INTEGER, GL_UNSIGNED_INT,
                   target.number.data() + corner);
    for (int y = 0; y < tile.height; y += kRows) {
        const int rows = std::min(kRows, tile.height - y);
        float* depth = target.depth.data() + corner + size_t(y) * stride;
        gl_.ReadPixels(0, y, tile.width, rows, GL_DEPTH_COMPONENT, GL_FLOAT, depth);
        for (int row = 0; row < rows; ++row, depth += stride) {
            if (view.orthographic) {
                decodeOrthographic(depth, tile.width, float(-coding.offset / coding.scale),
                                   float(-1.0 / coding.scale));
            } else {
                decodePerspective(depth, tile.width, float(coding.scale), float(coding.offset));
            }
        }
    }
    gl_.check("drawing");
}

void GlRenderer::render(const View& view, const RasterJob& job, RasterTarget& target) {
    target.width = view.subWidth();
    target.height = view.subHeight();
    target.depth.resize(size_t(target.width) * target.height);
    target.number.resize(size_t(target.width) * target.height);
    if (job.draws.empty() || !(view.near_z < view.far_z)) {
        return fillEmpty(view, 0, 0, target.width, target.height, target);
    }
    const DepthCoding coding = depthCoding(view, job);
    const int columns = (target.width + max_size_ - 1) / max_size_;
    const int tile_width = (target.width + columns - 1) / columns;
    const int max_height =
        int(std::min<int64_t>(max_size_, std::max<int64_t>(1, kMaxTileSubpixels / tile_width)));
    const int rows = (target.height + max_height - 1) / max_height;
    const int tile_height = (target.height + rows - 1) / rows;
    for (int y = 0; y < target.height; y += tile_height) {
        for (int x = 0; x < target.width; x += tile_width) {
            const Tile tile{x, y, std::min(tile_width, target.width - x),
                            std::min(tile_height, target.height - y)};
            collect(view, coding, tile, job);
            if (commands_.empty()) {
                fillEmpty(view, tile.x, tile.y, tile.width, tile.height, target);
                continue;
            }
            bindFramebuffer(tile.width, tile.height);
            drawCommands();
            readBack(view, coding, tile, target);
        }
    }
}

}  // namespace stipple
