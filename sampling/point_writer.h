// SPDX-License-Identifier: Apache-2.0
// Draws points of nodes into the sink, 64 at a time, from as many instances as it takes.
// Based on: Wand et al. 2001 ("Sample caching").
#pragma once

#include <sampling/tile_context.h>
#include <sampling/transform_kernel.h>

#include <array>

namespace stipple {

// How densely a node is drawn, and thinned.
struct RunDensity {
    double drawn = 0.0;   // points per m^2 of object space
    double wanted = 0.0;  // kept points per subpixel of exactly projected area (K, or less where
                          // no one could tell)
    bool narrow = false;  // points cover no more than the subpixel they lie in
    double layers = 1.0;  // of patches, one behind the other: they close each other's holes
};

class PointWriter {
public:
    explicit PointWriter(TileContext& context) : context_(context) {}

    // Points [first, first + count) of a sequence of an instance; first is a multiple of 16, unless
    // the sampler is random. density: of the area that the sequence is spread over.
    void add(const InstanceFrame& frame, const ListName& list, const RunDensity& density,
             uint32_t first, uint32_t count);
    // Where in a list an instance that needs few points begins: an aligned piece, another one for
    // each instance, so that equal trees do not show equal points. length: of the part of the list
    // that pieces are taken from.
    uint32_t firstOf(uint64_t path, uint32_t count, uint32_t length) const;
    // Hands over what has gathered.
    void flush();

private:
    // Consecutive points of one block of a list.
    struct Piece {
        KernelParams params;
        Run run;
        double wanted = 0.0;
        const ListBlock* block = nullptr;
        int lane = 0, count = 0;
    };
    static void prefetch(const Piece& piece);
    void drawNext();
    void handOver();
    bool markBlended(const ListBlock& list, int lane, int count, bool wants_layers,
                     const ListName& name, uint32_t first);

    TileContext& context_;
    size_t first_run_ = 0;  // of the block
    PointBlock block_;
    // Pieces that wait until their points have come from memory: a ring.
    static constexpr int kAhead = 4;
    std::array<Piece, kAhead> ahead_;
    std::array<ListBlock, kAhead> scratch_;  // of points that are in no list
    int first_ahead_ = 0, n_ahead_ = 0;
};

}  // namespace stipple
