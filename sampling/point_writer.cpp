// SPDX-License-Identifier: Apache-2.0
#include <sampling/point_writer.h>

#include <core/rng.h>

#include <bit>

namespace stipple {

namespace {

// Fitted to the coverage of single trees, 25 to 400 subpixels high, at K = 1, 3 and 12.
constexpr double kOverlap = 1.5;

// Lists grow by powers of two.
uint32_t listLength(uint64_t end) {
    return uint32_t(std::min<uint64_t>(std::bit_ceil(end), kLongestList));
}

KernelParams makeParams(const TileContext& context, const InstanceFrame& frame, ChildRef child,
                        uint32_t node_index, bool is_visible, const RunDensity& density) {
    const View& view = context.view;
    const Box3 bounds = nodeBounds(context.scene, child, node_index);
    const Box3 box = listBox(context.scene, child, node_index);
    KernelParams params;
    params.box_from_eye = Vec3(DVec3(box.min) - frame.eye_object);
    params.step = box.extent() / 65535.0f;
    params.camera_from_object = Mat3(frame.camera_from_object.linear);
    params.orthographic = view.orthographic;
    params.facing = Vec3(frame.facing);
    params.z_near = view.near_z;
    params.z_far = view.far_z;
    params.random = context.settings.sampler == Sampler::kRandom;
    params.hash = uint32_t(hashCombine(context.settings.seed, frame.path, node_index, 2));
    // The probability to keep a point is K * prj / density.
    const double f2 = view.focal * view.focal;
    params.gain = float(density.wanted * f2 * (view.orthographic ? 1.0 : frame.volume_scale) /
                        (32767.0 * density.drawn));
    params.thin = !is_visible;
    params.narrow = density.narrow;
    const DVec3 center = frame.camera_from_object.point(DVec3(bounds.center()));
    const double z = view.orthographic ? 1.0 : std::max(center.z, double(view.near_z));
    const double to_subpixels = std::sqrt(frame.area_scale * f2) / z;
    // A footprint balances a patch's holes against what its border gains (footprint.h), but in a
    // crown the holes are closed by the leaves behind: like narrower patches, which have fewer
    // holes.
    const double overlap = 1.0 + kOverlap * (density.layers - 1.0);
    params.width_offset = int(std::lround(std::log2(to_subpixels / overlap) * kWidthsPerOctave)) +
                          (kFirstMetreExponent - kFirstSubpixelExponent) * kWidthsPerOctave;
    return params;
}

}  // namespace

void PointWriter::add(const InstanceFrame& frame, const ListName& name, const RunDensity& density,
                      uint32_t first, uint32_t count) {
    if (count == 0) return;
    Piece piece;
    piece.params = makeParams(context_, frame, name.child, name.node,
                              name.direction != ListName::kWhole, density);
    piece.wanted = density.wanted;
    Run& run = piece.run;
    run.camera_from_normal = frame.camera_from_normal;
    run.length_scale = float(std::sqrt(frame.area_scale));
    run.child = name.child;
    run.node = name.node;
    run.direction = name.direction;
    run.path = frame.path;
    const uint32_t list_length = piece.params.random ? 0 : listLength(uint64_t(first) + count);
    while (count > 0) {
        const uint32_t n = std::min(count, kBlockPoints - first % kBlockPoints);
        piece.count = int(n);
        run.first_index = first;
        if (n_ahead_ == kAhead) drawNext();
        const size_t place = size_t((first_ahead_ + n_ahead_++) % kAhead);
        ListBlock& scratch = scratch_[place];
        piece.block = &context_.lists.points(name, first, int(n), list_length, scratch, piece.lane);
        run.block = piece.block == &scratch ? nullptr : piece.block;
        ahead_[place] = piece;
        prefetch(piece);
        first += n;
        count -= n;
    }
}

void PointWriter::prefetch(const Piece& piece) {
    const ListBlock& block = *piece.block;
    const auto read = [&](const auto& values) {
        constexpr size_t kLine = 64;
        const char* at = reinterpret_cast<const char*>(values + piece.lane);
        const char* end = reinterpret_cast<const char*>(values + piece.lane + piece.count);
        for (; at < end; at += kLine) __builtin_prefetch(at);
    };
    read(block.width);
    for (const auto& axis : block.position) read(axis);
    for (const auto& axis : block.normal) read(axis);
    read(block.single_sided);
}

// The first of those read ahead.
void PointWriter::drawNext() {
    const Piece& piece = ahead_[first_ahead_];
    first_ahead_ = (first_ahead_ + 1) % kAhead;
    --n_ahead_;
    const Run& run = piece.run;
    const ListBlock& list = *piece.block;
    const int n = piece.count;
    if (block_.count + n > kBlockPoints) handOver();
    if (block_.count == 0) first_run_ = context_.runs.size();
    transformPoints(piece.params, list, piece.lane, run.first_index, n, context_.nextNumber(),
                    block_.count, block_);
    const ListName name = {run.child, run.node, run.direction};
    const bool has_blended =
        context_.lists.identity().layers &&
        markBlended(list, piece.lane, n, context_.sink->wantsLayers(), name, run.first_index);
    if (has_blended || (!piece.params.narrow && context_.sink->wantsSurfels())) {
        const View& view = context_.view;
        makeSurfels(
            {run.camera_from_normal, float(view.focal), float(piece.wanted), view.orthographic},
            list, piece.lane, n, block_.count, block_);
    }
    context_.runs.push_back(run);
    block_.count += n;
}

// For sinks that want layers, tells which points are blended, if any; for others drops all but a
// share alpha of them.
bool PointWriter::markBlended(const ListBlock& list, int lane, int count, bool wants_layers,
                              const ListName& name, uint32_t first) {
    bool has_blended = false;
    for (int i = 0; i < count; ++i) {
        const uint8_t alpha = list.alpha[lane + i];
        uint8_t& keep = block_.keep[block_.count + i];
        if (alpha == 255 || !keep) continue;
        if (wants_layers) {
            keep = kBlended;
            has_blended = true;
        } else {
            const uint64_t key = hashCombine(context_.settings.seed, name.child.bits, name.node,
                                             uint64_t(first) + uint64_t(i), 10);
            keep = uniformFloat(key) * 255.0f < float(alpha);
        }
    }
    return has_blended;
}

uint32_t PointWriter::firstOf(uint64_t path, uint32_t count, uint32_t length) const {
    const RenderSettings& settings = context_.settings;
    const uint64_t hash = hashCombine(settings.seed, path, 5);
    if (settings.sampler == Sampler::kRandom) return uint32_t(hash);
    const uint32_t piece = std::max(16u, std::bit_ceil(count));
    return piece * 2 <= length ? uint32_t(hash % (length / piece)) * piece : 0;
}

void PointWriter::flush() {
    while (n_ahead_ > 0) drawNext();
    handOver();
}

void PointWriter::handOver() {
    if (block_.count > 0 && !context_.sink->take(block_)) context_.runs.resize(first_run_);
    block_.count = 0;
}

}  // namespace stipple
