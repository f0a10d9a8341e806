// SPDX-License-Identifier: Apache-2.0
// Draws raster jobs with a current GL context: shaders, buffers, the target with its two
// attachments (number as R32UI, reversed float depth). Knows GL, not where the context comes from.
#pragma once

#include <raster/gl.h>
#include <raster/mesh_arrays.h>

#include <array>
#include <optional>
#include <vector>

namespace stipple {

class GlRenderer {
public:
    // All calls on the thread where gl's context is current.
    GlRenderer(const Gl& gl, std::vector<RasterMesh> meshes, const std::vector<Material>& materials,
               const std::vector<Texture>& textures);
    // As Rasterizer::render.
    void render(const View& view, const RasterJob& job, RasterTarget& target);

private:
    struct GpuMesh {
        GLuint vertex_array = 0;
        std::vector<MeshRun> runs;
        Box3 bounds;
    };
    struct Framebuffer {
        int width = 0;
        int height = 0;
        GLuint framebuffer = 0;
        GLuint number = 0;
        GLuint depth = 0;
    };
    // A rectangle of the view, in subpixels.
    struct Tile {
        int x = 0;
        int y = 0;
        int width = 0;
        int height = 0;
    };
    // z_clip = scale * z_camera + offset; w_clip = z_camera (perspective) or 1.
    struct DepthCoding {
        double scale = 0.0;
        double offset = 1.0;
    };
    // Transposed clip_from_object: row i gives coordinate i of the clip space position.
    using ClipRows = std::array<glm::dvec4, 4>;
    // One multi-draw: pieces [begin, end) of counts_ and offsets_.
    struct Command {
        SurfaceState state;
        bool mirrored = false;
        uint32_t mesh = 0;
        uint32_t first_number = 0;
        std::array<Vec4, 4> clip_rows;
        size_t begin = 0;
        size_t end = 0;
    };

    const GpuMesh& gpuMesh(uint32_t index);
    GLuint maskTexture(int texture);
    void bindFramebuffer(int width, int height);
    DepthCoding depthCoding(const View& view, const RasterJob& job);
    void collect(const View& view, const DepthCoding& coding, const Tile& tile,
                 const RasterJob& job);
    void addDraw(const RasterJob& job, const RasterDraw& draw, const GpuMesh& mesh,
                 Command command);
    void drawCommands();
    void readBack(const View& view, const DepthCoding& coding, const Tile& tile,
                  RasterTarget& target);

    Gl gl_;
    std::vector<RasterMesh> meshes_;
    const std::vector<Material>& materials_;
    const std::vector<Texture>& textures_;
    std::vector<AlphaRange> texture_alpha_;
    std::vector<std::optional<GpuMesh>> gpu_meshes_;
    std::vector<GLuint>
        mask_textures_;  // one a texture, 0 until it is needed; the last one is opaque
    GLuint opaque_program_ = 0;
    GLuint masked_program_ = 0;
    std::array<Framebuffer, 2>
        framebuffers_;  // the latest first: a picture's and a shadow map's are in turn
    int max_size_ = 0;

    std::vector<Command> commands_;
    std::vector<GLsizei> counts_;
    std::vector<const void*> offsets_;
};

}  // namespace stipple
