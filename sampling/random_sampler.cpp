// SPDX-License-Identifier: Apache-2.0
#include <sampling/random_sampler.h>

#include <core/rng.h>
#include <sampling/node_class.h>
#include <sampling/transform_kernel.h>
#include <scenegraph/object_id.h>
#include <scenegraph/surface_at.h>

#include <algorithm>
#include <bit>
#include <tuple>

namespace stipple {

namespace {

// Barycentrics (u, v) of the ray's intersection with the triangle's plane, clamped to the triangle.
Vec2 intersectPlane(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& origin,
                    const Vec3& direction) {
    const Vec3 e1 = b - a, e2 = c - a, p = glm::cross(direction, e2), s = origin - a,
               q = glm::cross(s, e1);
    const float determinant = glm::dot(e1, p);
    const float inverse = determinant != 0.0f ? 1.0f / determinant : 0.0f;
    const float u = std::clamp(glm::dot(s, p) * inverse, 0.0f, 1.0f);
    return {u, std::clamp(glm::dot(direction, q) * inverse, 0.0f, 1.0f - u)};
}

// Unit normal in world space.
Vec3 worldNormal(const View& view, const Mat3& camera_from_normal, const Vec3& n_object) {
    return glm::normalize(Mat3(glm::transpose(view.camera_from_world)) *
                          (camera_from_normal * n_object));
}

// Attributes of a triangle of an instance where the ray through sub_x, sub_y meets it at
// sample.depth.
void triangleAttributes(const Scene& scene, const View& view, const InstanceFrame& frame,
                        uint32_t mesh_index, uint32_t triangle, float sub_x, float sub_y,
                        SurfaceSample& sample) {
    const Mesh& mesh = scene.meshes[mesh_index];
    const UVec3& t = mesh.triangles[triangle];
    const Mat3 linear(frame.camera_from_object.linear);
    const Vec3 translation(frame.camera_from_object.translation);
    Vec3 origin, direction;
    view.ray(sub_x, sub_y, origin, direction);
    const Vec2 uv = intersectPlane(linear * mesh.positions[t.x] + translation,
                                   linear * mesh.positions[t.y] + translation,
                                   linear * mesh.positions[t.z] + translation, origin, direction);
    const float footprint =
        (view.orthographic ? 1.0f : sample.depth) / float(view.focal * std::sqrt(frame.area_scale));
    const MeshSurface surface =
        surfaceAt(mesh, scene.materials, scene.textures, triangle, uv.x, uv.y, footprint);
    sample.normal_world = worldNormal(view, frame.camera_from_normal, surface.normal_object);
    sample.albedo = surface.albedo;
    sample.material = mesh.triangle_material[triangle];
    sample.object = objectId(frame.path);
}

class SamplerTile : public TileEmitter {
public:
    SamplerTile(const Scene& scene, const View& view, const RenderSettings& settings,
                const FramePlan& plan, PointLists& lists)
        : scene_(scene), view_(view), settings_(settings), plan_(plan), lists_(lists) {}

    void emit(const Batch& batch, PointSink& sink) override {
        const PlannedNode& planned = plan_.nodes[batch.index];
        sink_ = &sink;
        if (planned.child.isGroup()) {
            drawGroupNode(scene_.groups[planned.child.index()], planned.child, planned.node,
                          planned.camera_from_child, planned.path);
        } else {
            drawInstance(planned.child.index(), planned.node, planned.camera_from_child,
                         planned.path);
        }
    }

    void attributes(uint32_t number, float sub_x, float sub_y,
                    SurfaceSample& sample) const override {
        const Run& run = runOf(number);
        const uint32_t index = run.first_index + number % kBlockPoints;
        if (run.triangle_frame != kNotTriangles) {
            triangleAttributes(scene_, view_, triangle_frames_[run.triangle_frame], run.mesh, index,
                               sub_x, sub_y, sample);
            return;
        }
        int lane;
        ListBlock scratch;
        const ListBlock& block =
            lists_.points(run.mesh, run.node, index, 1, run.list_length, scratch, lane);
        sample.normal_world = worldNormal(view_, run.camera_from_normal,
                                          unpackOctahedral(block.shading_normal[lane]));
        sample.albedo = unpackSrgb8(block.albedo[lane]);
        sample.material = block.material[lane];
        sample.object = run.object;
    }

    void forget() override {
        runs_.clear();
        triangle_frames_.clear();
    }

private:
    static constexpr uint32_t kNotTriangles = 0xffffffffu;

    // What attributes() must know of up to 64 consecutive numbers.
    struct Run {
        Mat3 camera_from_normal = Mat3(1.0f);
        uint32_t mesh = 0, node = 0;
        uint32_t first_index = 0;  // of the node's list, or of the mesh's triangles
        uint32_t list_length = 0;
        uint32_t object = 0;
        uint32_t triangle_frame = kNotTriangles;
    };

    // A child of a node that is being opened, to be visited near before far.
    struct Opened {
        float z_min;
        uint32_t index;  // of the node, or of the instance
        bool is_instance;
        BoxProjection box;
    };

    const Run& runOf(uint32_t number) const { return runs_[(number & ~kKindBits) / kBlockPoints]; }

    bool isWanted(const BoxProjection& box) const {
        return box.is_visible && box.rect.overlaps(sink_->region()) &&
               !sink_->hides(box.rect, box.z_min);
    }

    // A node of a group: points, if all of it is far enough, else what it opens to.
    void drawGroupNode(const Group& group, ChildRef ref, uint32_t node_index,
                       const Affine& camera_from_group, uint64_t path) {
        const GroupNode& node = group.nodes[node_index];
        const BoxProjection box =
            projectBox(view_, camera_from_group.linear, camera_from_group.translation, node.bounds);
        if (!isWanted(box) || !(node.area > 0.0)) return;
        if (node.count > 1 && box.depth_ratio <= settings_.cut_ratio) {
            const double bound = box.bound * maxAreaScale(camera_from_group.linear);
            const double n = settings_.samples * bound * node.area;
            if (node.max_triangle_area * bound <= settings_.area_threshold &&
                (box.size <= kTileShare * float(settings_.tile_size) || n <= kFewPoints) &&
                n <= kMostOverdraw * double(box.rect.width()) * double(box.rect.height())) {
                samplePoints(group, ref, node_index, camera_from_group, path,
                             settings_.samples * bound, n);
                return;
            }
        }
        std::vector<Opened> opened;
        for (uint32_t i = node.first; i < node.first + node.resident_count; ++i) {
            const Affine camera_from_child = camera_from_group * group.instances.groupFromChild(i);
            const ChildRef child = group.instances.child(i);
            const Box3 bounds = child.isGroup() ? scene_.groups[child.index()].nodes[0].bounds
                                                : scene_.meshes[child.index()].bounds;
            const BoxProjection b =
                projectBox(view_, camera_from_child.linear, camera_from_child.translation, bounds);
            if (isWanted(b)) opened.push_back({b.z_min, i, true, b});
        }
        for (uint32_t c = node.first_child; c < node.first_child + node.child_count; ++c) {
            const BoxProjection b =
                projectBox(view_, camera_from_group.linear, camera_from_group.translation,
                           group.nodes[c].bounds);
            if (isWanted(b)) opened.push_back({b.z_min, c, false, b});
        }
        sortOpened(opened.data(), opened.data() + opened.size());
        for (const Opened& o : opened) {
            if (sink_->hides(o.box.rect, o.z_min)) continue;
            if (!o.is_instance) {
                drawGroupNode(group, ref, o.index, camera_from_group, path);
                continue;
            }
            const Affine camera_from_child =
                camera_from_group * group.instances.groupFromChild(o.index);
            const ChildRef child = group.instances.child(o.index);
            const uint64_t child_path = extendObjectPath(path, group.listed_index[o.index]);
            if (child.isGroup()) {
                drawGroupNode(scene_.groups[child.index()], child, 0, camera_from_child,
                              child_path);
            } else {
                drawInstance(child.index(), 0, camera_from_child, child_path);
            }
        }
    }

    static void sortOpened(Opened* begin, Opened* end) {
        std::sort(begin, end, [](const Opened& a, const Opened& b) {
            return a.z_min != b.z_min
                       ? a.z_min < b.z_min
                       : std::tie(a.is_instance, a.index) < std::tie(b.is_instance, b.index);
        });
    }

    void drawInstance(uint32_t mesh_index, uint32_t node_index, const Affine& camera_from_object,
                      uint64_t path) {
        if (scene_.meshes[mesh_index].triangles.empty()) return;
        const InstanceFrame frame = makeInstanceFrame(camera_from_object, path);
        uint32_t triangle_frame = kNotTriangles;
        const BoxProjection box =
            projectBox(view_, camera_from_object.linear, camera_from_object.translation,
                       scene_.meshes[mesh_index].nodes[node_index].bounds);
        drawMeshNode(frame, mesh_index, node_index, box, triangle_frame);
    }

    // The cut through a mesh's octree. triangle_frame: where the instance stands in
    // triangle_frames_, once it does.
    void drawMeshNode(const InstanceFrame& frame, uint32_t mesh_index, uint32_t node_index,
                      const BoxProjection& box, uint32_t& triangle_frame) {
        if (!isWanted(box)) return;
        const Mesh& mesh = scene_.meshes[mesh_index];
        const MeshNode& node = mesh.nodes[node_index];
        switch (classifyNode(node, box, frame.area_scale, settings_)) {
            case NodeClass::kPoints: {
                const double draw_density = settings_.samples * box.bound * frame.area_scale;
                const uint64_t key =
                    hashCombine(settings_.seed, frame.path, mesh_index, node_index);
                const uint64_t count = roundAtRandom(std::min(draw_density * node.area, 1e9), key);
                const bool random = settings_.sampler == Sampler::kRandom;
                const uint32_t first = random ? uint32_t(mixBits(key)) : 0;
                if (count > 0)
                    emitRun(frame, mesh_index, node_index, draw_density, first, uint32_t(count));
                return;
            }
            case NodeClass::kTriangles:
                if (triangle_frame == kNotTriangles) {
                    triangle_frame = uint32_t(triangle_frames_.size());
                    triangle_frames_.push_back(frame);
                }
                emitTriangles(frame, mesh_index, node, triangle_frame);
                return;
            case NodeClass::kLargeTriangles:
                return;  // in the z-buffer already
            case NodeClass::kOpen:
                break;
        }
        Opened opened[32];  // a node has at most max(8, kMaxStrata) children
        int n_opened = 0;
        for (uint32_t c = node.first_child; c < node.first_child + node.child_count; ++c) {
            const BoxProjection b =
                projectBox(view_, frame.camera_from_object.linear,
                           frame.camera_from_object.translation, mesh.nodes[c].bounds);
            if (isWanted(b)) opened[n_opened++] = {b.z_min, c, false, b};
        }
        sortOpened(opened, opened + n_opened);
        for (int i = 0; i < n_opened; ++i) {
            drawMeshNode(frame, mesh_index, opened[i].index, opened[i].box, triangle_frame);
        }
    }

    void emitTriangles(const InstanceFrame& frame, uint32_t mesh_index, const MeshNode& node,
                       uint32_t triangle_frame) {
        const Mesh& mesh = scene_.meshes[mesh_index];
        const Mat3 linear(frame.camera_from_object.linear);
        const Vec3 translation(frame.camera_from_object.translation);
        for (uint32_t first = 0; first < node.triangle_count; first += kBlockPoints) {
            TriangleBlock& block = triangle_block_;
            block.count = int(std::min<uint32_t>(kBlockPoints, node.triangle_count - first));
            block.first_number = uint32_t(runs_.size()) * kBlockPoints | kTriangleBit;
            for (int i = 0; i < block.count; ++i) {
                const UVec3& t = mesh.triangles[node.first_triangle + first + uint32_t(i)];
                for (int k = 0; k < 3; ++k) {
                    const Vec3 p = linear * mesh.positions[t[k]] + translation;
                    block.x[k][i] = p.x, block.y[k][i] = p.y, block.z[k][i] = p.z;
                }
            }
            const Stratum& stratum = mesh.strata[node.stratum];
            Run run;
            run.mesh = mesh_index;
            run.first_index = node.first_triangle + first;
            run.triangle_frame = triangle_frame;
            run.object = objectId(frame.path);
            runs_.push_back(run);
            if (!stratum.double_sided) dropBackFaces(frame, block);
            const TriangleMask mask(*this, block.first_number, block);
            block.mask = stratum.masked ? &mask : nullptr;
            if (!sink_->take(block)) runs_.pop_back();
        }
    }

    // Single-sided triangles seen from behind become degenerate, so that numbers stay in place.
    void dropBackFaces(const InstanceFrame& frame, TriangleBlock& block) const {
        const float sign = glm::determinant(frame.camera_from_object.linear) < 0.0 ? -1.0f : 1.0f;
        for (int i = 0; i < block.count; ++i) {
            const Vec3 a = block.vertex(0, i);
            const Vec3 n = glm::cross(block.vertex(1, i) - a, block.vertex(2, i) - a) * sign;
            if ((view_.orthographic ? n.z : glm::dot(n, a)) < 0.0f) continue;
            for (int k = 1; k < 3; ++k)
                block.x[k][i] = a.x, block.y[k][i] = a.y, block.z[k][i] = a.z;
        }
    }

    // Alpha at a place on an emitted triangle.
    class TriangleMask : public MaskTest {
    public:
        TriangleMask(const SamplerTile& tile, uint32_t first_number, const TriangleBlock& block)
            : tile_(tile), first_number_(first_number), block_(block) {}
        bool isSurface(int triangle, float sub_x, float sub_y) const override {
            const Run& run = tile_.runOf(first_number_);
            const uint32_t t = run.first_index + uint32_t(triangle);
            const Mesh& mesh = tile_.scene_.meshes[run.mesh];
            const Material& material = tile_.scene_.materials[mesh.triangle_material[t]];
            if (material.alpha_mode == AlphaMode::kOpaque) return true;
            Vec3 origin, direction;
            tile_.view_.ray(sub_x, sub_y, origin, direction);
            const Vec2 uv = intersectPlane(block_.vertex(0, triangle), block_.vertex(1, triangle),
                                           block_.vertex(2, triangle), origin, direction);
            const float alpha =
                alphaAt(mesh, tile_.scene_.materials, tile_.scene_.textures, t, uv.x, uv.y);
            if (material.alpha_mode == AlphaMode::kMask) return alpha >= material.alpha_cutoff;
            const uint64_t place =
                hashCombine(run.object, t, uint64_t(int64_t(sub_x)), uint64_t(int64_t(sub_y)));
            return uniformFloat(hashCombine(tile_.settings_.seed, place)) < alpha;
        }

    private:
        const SamplerTile& tile_;
        const uint32_t first_number_;
        const TriangleBlock& block_;
    };

    // Points on everything below a group's node, n in expectation. draw_density: per m^2 of the
    // group's own space.
    void samplePoints(const Group& group, ChildRef ref, uint32_t node_index,
                      const Affine& camera_from_group, uint64_t path, double draw_density,
                      double n) {
        const GroupNode& node = group.nodes[node_index];
        const uint64_t key = hashCombine(settings_.seed, path, ref.bits, node_index);
        const uint64_t count = roundAtRandom(n, key);
        if (count == 0) return;
        draw_density_ = draw_density;
        if (settings_.sampler == Sampler::kRandom) {
            for (uint64_t k = 0; k < count; ++k) {
                const uint64_t h = hashCombine(key, k, 1);
                drawInGroup(group, node_index, camera_from_group, path, 1.0,
                            uniformDouble(h) * node.area, uint32_t(mixBits(h)));
            }
        } else {
            spacing_ = node.area / double(count);
            phase_ = uniformDouble(mixBits(key));
            sweepGroup(group, node_index, camera_from_group, path, 0.0, 1.0);
        }
    }

    // Points per m^2 of the child's own space where `scale` carries its areas to the batch's node.
    double childDensity(double scale) const { return draw_density_ * scale; }

    // Systematic sampling: the batch's points lie at (k + phase) * spacing along the cumulated
    // areas of everything below its node, in octree order. Passes a range on to whom it belongs, so
    // only subtrees with points are visited.
    void sweepGroup(const Group& group, uint32_t node_index, const Affine& camera_from_group,
                    uint64_t path, double base, double scale) {
        const GroupNode& node = group.nodes[node_index];
        for (uint32_t i = node.first; i < node.first + node.resident_count; ++i) {
            const ChildRef child = group.instances.child(i);
            const double child_scale = scale * group.instances.areaScale(i);
            const double end = base + childArea(child) * child_scale;
            const uint64_t count = pointsBefore(end) - pointsBefore(base);
            if (count > 0) {
                const Affine camera_from_child =
                    camera_from_group * group.instances.groupFromChild(i);
                const uint64_t child_path = extendObjectPath(path, group.listed_index[i]);
                if (child.isGroup()) {
                    sweepGroup(scene_.groups[child.index()], 0, camera_from_child, child_path, base,
                               child_scale);
                } else {
                    emitInstance(camera_from_child, child.index(), child_path, child_scale,
                                 uint32_t(count));
                }
            }
            base = end;
        }
        for (uint32_t c = node.first_child; c < node.first_child + node.child_count; ++c) {
            const double end = base + group.nodes[c].area * scale;
            if (pointsBefore(end) > pointsBefore(base))
                sweepGroup(group, c, camera_from_group, path, base, scale);
            base = end;
        }
    }

    uint64_t pointsBefore(double position) const {
        return uint64_t(std::max(0.0, std::ceil(position / spacing_ - phase_)));
    }

    double childArea(ChildRef child) const {
        return child.isGroup() ? scene_.groups[child.index()].area
                               : scene_.meshes[child.index()].area;
    }

    // One point at `target` along the cumulated areas: down the tree of sums to an instance of a
    // mesh.
    void drawInGroup(const Group& group, uint32_t node_index, const Affine& camera_from_group,
                     uint64_t path, double scale, double target, uint32_t index) {
        const GroupNode* node = &group.nodes[node_index];
        for (bool is_found = false; !is_found;) {
            is_found = true;
            double residents = node->area;
            for (uint32_t c = 0; c < node->child_count; ++c)
                residents -= group.nodes[node->first_child + c].area;
            if (node->child_count == 0 || target < residents) break;
            target -= residents;
            for (uint32_t c = 0; c < node->child_count; ++c) {
                const GroupNode& child = group.nodes[node->first_child + c];
                if (target < child.area || c + 1u == node->child_count) {
                    node = &child;
                    is_found = false;
                    break;
                }
                target -= child.area;
            }
        }
        for (uint32_t i = node->first; i < node->first + node->resident_count; ++i) {
            const ChildRef child = group.instances.child(i);
            const double area_scale = group.instances.areaScale(i);
            const double area = childArea(child) * area_scale;
            if (target >= area && i + 1 < node->first + node->resident_count) {
                target -= area;
                continue;
            }
            const Affine camera_from_child = camera_from_group * group.instances.groupFromChild(i);
            const uint64_t child_path = extendObjectPath(path, group.listed_index[i]);
            if (child.isGroup()) {
                drawInGroup(scene_.groups[child.index()], 0, camera_from_child, child_path,
                            scale * area_scale,
                            std::min(target / area_scale, scene_.groups[child.index()].area),
                            index);
            } else {
                emitRun(makeInstanceFrame(camera_from_child, child_path), child.index(), 0,
                        childDensity(scale * area_scale), index, 1);
            }
            return;
        }
    }

    // Some points of a whole mesh instance within a far group: an aligned piece of its list,
    // another one for each instance, so that equal trees do not show equal points.
    void emitInstance(const Affine& camera_from_object, uint32_t mesh, uint64_t path, double scale,
                      uint32_t count) {
        const InstanceFrame frame = makeInstanceFrame(camera_from_object, path);
        // The group's node was drawn for its nearest corner; this instance may need fewer.
        double density = childDensity(scale);
        const double needed = settings_.samples * instanceBound(frame, scene_.meshes[mesh].bounds);
        if (needed < density) {
            count =
                uint32_t(roundAtRandom(count * (needed / density), mixBits(path ^ settings_.seed)));
            density = needed;
            if (count == 0) return;
        }
        const uint32_t piece = std::bit_ceil(count);
        const uint32_t length = uint32_t(settings_.list_length);
        const uint32_t first =
            piece * 2 <= length ? uint32_t(path >> 8) % (length / piece) * piece : 0;
        emitRun(frame, mesh, 0, density, first, count);
    }

    // Bound of the projection factor over an instance, by its bounding sphere; infinite near the
    // eye.
    double instanceBound(const InstanceFrame& frame, const Box3& bounds) const {
        const double f2 = view_.focal * view_.focal * frame.area_scale;
        if (view_.orthographic) return f2;
        const DVec3 c = frame.camera_from_object.point(DVec3(bounds.center()));
        const double r = 0.5 * glm::length(DVec3(bounds.extent())) *
                         maxLengthScale(frame.camera_from_object.linear);
        const double z = c.z - r;
        if (z < view_.near_z) return std::numeric_limits<double>::infinity();
        const double x = (std::abs(c.x) + r) / z, y = (std::abs(c.y) + r) / z;
        return f2 * std::sqrt(1.0 + x * x + y * y) / (z * z);
    }

    // Points [first, first + count) of a mesh node of one instance. density: drawn points per m^2
    // of object space.
    void emitRun(const InstanceFrame& frame, uint32_t mesh_index, uint32_t node_index,
                 double density, uint32_t first, uint32_t count) {
        const Mesh& mesh = scene_.meshes[mesh_index];
        const MeshNode& node = mesh.nodes[node_index];
        KernelParams params;
        params.box_from_eye = Vec3(DVec3(node.bounds.min) - frame.eye_object);
        params.step = node.bounds.extent() / 65535.0f;
        params.camera_from_object = Mat3(frame.camera_from_object.linear);
        params.orthographic = view_.orthographic;
        params.facing = Vec3(frame.facing);
        params.z_near = view_.near_z;
        params.random = settings_.sampler == Sampler::kRandom;
        params.hash = uint32_t(hashCombine(settings_.seed, frame.path, node_index, 2));
        fillGains(frame, mesh, node, density, params);

        Run run;
        run.camera_from_normal = frame.camera_from_normal;
        run.mesh = mesh_index;
        run.node = node_index;
        run.list_length = params.random ? 0 : listLength(first + count);
        run.object = objectId(frame.path);
        block_.patch = patch_;
        block_.patch_count = int(mesh.strata.size());
        while (count > 0) {
            const uint32_t n = std::min(count, kBlockPoints - first % kBlockPoints);
            int lane;
            const ListBlock& list = lists_.points(mesh_index, node_index, first, int(n),
                                                  run.list_length, scratch_, lane);
            block_.count = int(n);
            block_.first_number = uint32_t(runs_.size()) * kBlockPoints;
            block_.stratum = list.stratum + lane;
            run.first_index = first;
            runs_.push_back(run);
            transformPoints(params, list, lane, first, block_);
            if (!sink_->take(block_)) runs_.pop_back();
            first += n;
            count -= n;
        }
    }

    // Lists grow by powers of two, up to the longest prefix that is worth keeping; what lies beyond
    // is drawn anew.
    uint32_t listLength(uint64_t end) const {
        return uint32_t(std::min<uint64_t>(std::bit_ceil(end), kLongestList));
    }

    // The probability to keep a point is K * prj / density.
    void fillGains(const InstanceFrame& frame, const Mesh& mesh, const MeshNode& node,
                   double density, KernelParams& params) {
        const double f2 = view_.focal * view_.focal;
        const double gain = settings_.samples * f2 *
                            (view_.orthographic ? 1.0 : frame.volume_scale) / (32767.0 * density);
        const DVec3 center = frame.camera_from_object.point(DVec3(node.bounds.center()));
        const double z = std::max(center.z, double(view_.near_z));
        const double to_subpixels =
            std::sqrt(frame.area_scale * f2) / (view_.orthographic ? 1.0 : z);
        const size_t begin = node.stratum == kMixedStratum ? 0 : node.stratum;
        const size_t end = node.stratum == kMixedStratum ? mesh.strata.size() : begin + 1;
        for (size_t s = begin; s < end; ++s) {
            patch_[s] = float(mesh.strata[s].patch_width * to_subpixels);
            params.gain_front[s] = float(gain);
            params.gain_back[s] = mesh.strata[s].double_sided ? params.gain_front[s] : 0.0f;
        }
    }

    static constexpr uint64_t kLongestList = 4096;

    const Scene& scene_;
    const View& view_;
    const RenderSettings& settings_;
    const FramePlan& plan_;
    PointLists& lists_;
    PointSink* sink_ = nullptr;
    double draw_density_ = 0.0, spacing_ = 1.0, phase_ = 0.0;  // of the group node being sampled
    std::vector<Run> runs_;
    std::vector<InstanceFrame> triangle_frames_;
    PointBlock block_;
    TriangleBlock triangle_block_;
    ListBlock scratch_;
    float patch_[16] = {};
};

}  // namespace

const FramePlan& RandomizedSampler::plan(const View& view, const RenderSettings& settings,
                                         ThreadPool& pool, const CancelFlag* cancel) {
    view_ = view;
    settings_ = settings;
    lists_.startFrame({settings.seed, settings.sampler}, size_t(settings.cache_mb) << 20);
    plan_ = planFrame(scene_, view, settings, false, pool, cancel);
    return plan_;
}

std::unique_ptr<TileEmitter> RandomizedSampler::makeEmitter() {
    return std::make_unique<SamplerTile>(scene_, view_, settings_, plan_, lists_);
}

void rasterAttributes(const Scene& scene, const View& view, const FramePlan& plan, uint32_t number,
                      float sub_x, float sub_y, SurfaceSample& sample) {
    // The draw whose numbers hold it: numbers of a draw begin at first_number + its lowest
    // triangle.
    const auto begin = plan.raster.draws.begin();
    const auto firstOf = [&](const RasterDraw& d) {
        return d.first_number + plan.raster.ranges[d.range_begin].first;
    };
    const auto found =
        std::upper_bound(begin, plan.raster.draws.end(), number,
                         [&](uint32_t n, const RasterDraw& d) { return n < firstOf(d); });
    const size_t draw = size_t(found - begin) - 1;
    const RasterInstance& instance = plan.raster_instances[draw];
    triangleAttributes(scene, view, instance.frame, instance.mesh,
                       number - plan.raster.draws[draw].first_number, sub_x, sub_y, sample);
}

}  // namespace stipple
