// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/front_means.h>

#include <reconstruct/erode.h>
#include <reconstruct/per_pixel.h>

namespace stipple {

namespace {

// A patch at least this many squares wide is a surface.
constexpr float kWideInSides = 4.0f;

}  // namespace

int closingSide(double k) {
    constexpr int kMost = 15;
    int side = 3;
    while (side < kMost && double(side) * double(side) * k < 6.0) side += 2;
    return side;
}

FrontMeans::FrontMeans(const ReconstructionContext& context)
    : context_(context),
      side_(closingSide(context.settings.samples)),
      split_(context_, codesFromWidth(kWideInSides * float(side_)), side_),
      slack_(context.view) {}

// Filling looks two subpixels around, twice, and erosion as far as points reach, at what points
// reach from further away, or at what covers them there.
int FrontMeans::halo() const { return 5 + 2 * split_.reach(false); }

void FrontMeans::beginTile(const SubpixelRect& inner, const SubpixelRect& shown,
                           const SubpixelRect& outer) {
    tile_.reset(outer, context_.base, kZBufferBit);
    surfaces_.reset(outer, context_.base, kZBufferBit);
    split_.begin(inner);
    shaded_.reset(shown);
    shader_.forget();
}

void FrontMeans::beginPass(int pass, const SampleLookup& lookup) {
    pass_ = pass;
    lookup_ = &lookup;
    if (pass == 0) return;
    closeSurfaces();
    if (context_.settings.fill) fillHoles(tile_, context_.view, scratch_);
    tile_.refreshHidden();
}

bool FrontMeans::hides(const SubpixelRect& rect, float z_min, bool narrow) const {
    if (pass_ == 1) return tile_.hides(rect, slack_.frontOf(z_min));
    const auto grown = [&](int by) {
        return SubpixelRect{rect.x0 - by, rect.y0 - by, rect.x1 + by, rect.y1 + by};
    };
    // Narrow points go into tile_ alone, each into its own subpixel.
    if (narrow) return tile_.hides(rect, z_min) || surfaces_.hides(grown(side_ / 2), z_min);
    // Erosion shows nothing farther than what is there within the reach of a square, and
    // surfaces behind all that tile_ shows so far around are dropped before.
    const SubpixelRect around = grown(split_.reach(false) + side_ / 2);
    return tile_.hides(around, z_min) || surfaces_.hides(around, z_min);
}

bool FrontMeans::take(const PointBlock& block) {
    if (pass_ == 0) return split_.take(block, tile_, surfaces_).is_used;
    average(block);
    return false;
}

bool FrontMeans::take(const TriangleBlock& block) {
    return pass_ == 0 && split_.take(block, tile_);
}

// Large surfaces, eroded, into tile_. What hides() lets be left out must change nothing here.
void FrontMeans::closeSurfaces() {
    dropHiddenSurfaces();
    // A surface may go on in triangles.
    for (size_t i = 0; i < tile_.keys().size(); ++i) {
        const uint64_t key = tile_.keys()[i];
        if (DepthTile::numberOf(key) != kNoNumber && DepthTile::numberOf(key) & kAnyTriangle)
            surfaces_.keys()[i] = std::min(surfaces_.keys()[i], key);
    }
    // What is left open is a subpixel or two, erosion would make a square of it.
    if (context_.settings.fill) fillHoles(surfaces_, context_.view, scratch_);
    erodeSplats(
        surfaces_, [&](float) { return side_ / 2; }, scratch_);
    for (size_t i = 0; i < scratch_.size(); ++i) {
        uint64_t& key = tile_.keys()[i];
        const uint64_t near_key = surfaces_.keys()[i], far_key = scratch_[i];
        // Points all around: a surface goes on here, and must not sink below a triangle close
        // behind it for the depth that it gains within a square.
        const bool is_within = key < far_key && far_key != DepthTile::kEmpty &&
                               !(DepthTile::numberOf(far_key) & kAnyTriangle) &&
                               DepthTile::numberOf(key) & kAnyTriangle;
        key = std::min(key, is_within ? near_key : far_key);
    }
}

// Surfaces behind all that tile_ shows within half a square are not seen wherever erosion might
// show them.
void FrontMeans::dropHiddenSurfaces() {
    farthestWithin(tile_, side_ / 2, scratch_);
    for (size_t i = 0; i < scratch_.size(); ++i) {
        uint64_t& key = surfaces_.keys()[i];
        if (DepthTile::depthOf(key) > DepthTile::depthOf(scratch_[i])) key = DepthTile::kEmpty;
    }
}

// Sums of the points on each subpixel's front; `covered` counts them.
void FrontMeans::average(const PointBlock& block) {
    const View& view = context_.view;
    const SubpixelRect& rect = shaded_.rect;
    for (int i = 0; i < block.count; ++i) {
        if (block.keep[i] != 1) continue;
        const Vec3 p_camera(block.x[i], block.y[i], block.z[i]);
        const Vec2 p = view.project(p_camera);
        if (!(p.x >= float(rect.x0) && p.x < float(rect.x1) && p.y >= float(rect.y0) &&
              p.y < float(rect.y1)))
            continue;
        const int x = int(p.x), y = int(p.y);
        const uint64_t front = tile_.row(y)[x];
        // A triangle is exact, it needs no points.
        if (DepthTile::numberOf(front) & kAnyTriangle ||
            !slack_.isOnFront(block.z[i], DepthTile::depthOf(front), block.width[i]))
            continue;
        shader_.showPoint(*lookup_, p_camera, block.number[i], p);
        ShadedSubpixel& sum = shaded_.row(y)[x];
        sum.radiance += shader_.radiance();
        sum.covered += 1.0f;
    }
}

// Means, and the front itself where no point lies in the subpixel.
ShadedTile& FrontMeans::finish(const SampleLookup& lookup) {
    shader_.forget();
    for (int y = shaded_.rect.y0; y < shaded_.rect.y1; ++y) {
        const uint64_t* keys = tile_.row(y);
        ShadedSubpixel* row = shaded_.row(y);
        for (int x = shaded_.rect.x0; x < shaded_.rect.x1; ++x) {
            if (DepthTile::numberOf(keys[x]) == kNoNumber) continue;
            if (row[x].covered > 0.0f) {
                row[x].radiance /= row[x].covered;
            } else {
                shader_.show(lookup, keys[x], x, y);
                row[x].radiance = shader_.radiance();
            }
            row[x].covered = 1.0f;
            row[x].depth = DepthTile::depthOf(keys[x]);
        }
    }
    return shaded_;
}

}  // namespace stipple
