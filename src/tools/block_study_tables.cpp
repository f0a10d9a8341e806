// SPDX-License-Identifier: Apache-2.0
#include <tools/block_study.h>

#include <algorithm>

namespace stipple {

namespace {

// Without rows.
const std::vector<StudyTable>& allTables() {
    static const std::vector<StudyTable> tables = {
        {"models",
         "Models (thesis: table 8.1)",
         "Size of the file, blocks and points of the finest level, bits a point "
         "of all levels, points a pixel "
         "of the surface at unit magnification, building; frames at unit "
         "magnification, against one centred ray; holes of all views against 16.",
         {"model"},
         {"MB", "blocks", "points", "bits_per_point", "points_per_pixel", "build_s", "frame_ms",
          "psnr_db", "holes"},
         {}},
        {"views",
         "Random views",
         "From random directions, one subpixel a pixel: pixels that are holes, against 16 rays, of "
         "all views; views that have any; the most of one view; quality against one centred ray. "
         "At unit magnification; about random points of the surface; with the model at the edge of "
         "a wide picture.",
         {"model", "view"},
         {"views", "holes", "views_with_holes", "most_holes", "mean_psnr_db", "worst_psnr_db"},
         {}},
        {"phases",
         "Milliseconds by phase (thesis: table 8.2)",
         "One thread. Visibility: cones and masks of all blocks. Warp: points to "
         "camera space. Depth: into the z-buffer, what is hidden left out (below "
         "0 where that saves warping). Gaps: found and filled. Shade: looked up, "
         "shaded, written. Then the whole frame by pull and push. Last, million points "
         "of the blocks that are not culled by seconds of warp.",
         {"model"},
         {"visibility_ms", "warp_ms", "depth_ms", "gaps_ms", "shade_ms", "total_ms",
          "pull_push_total_ms", "warp_million_points_s"},
         {}},
        {"culling",
         "Per cent of blocks culled (thesis: table 8.3)",
         "Means of views from everywhere.",
         {"model"},
         {"neither", "cone", "mask", "both"},
         {}},
        {"sizes",
         "Size and time over tolerance angle, block size and lattice (thesis: "
         "figures 5.5, 5.6, 5.7)",
         "Relative to the model as it is built by default; time is of the frame, "
         "draw_time of its points without shading. As the thesis: whole "
         "blocks, taken as they come; else single samples that others make up for "
         "are left out.",
         {"model", "what", "value"},
         {"points", "blocks", "size", "time", "draw_time", "build_s"},
         {}},
        {"visibility",
         "Cones and bits of masks (thesis: figure 6.7)",
         "Blocks left out, milliseconds of visibility and warp, and of the "
         "frame.",
         {"model", "tests"},
         {"culled_percent", "warp_ms", "frame_ms"},
         {}},
        {"screen",
         "Masks over the screen's subdivision (thesis: figure 6.8)",
         "Per cent of blocks culled by masks alone, the screen in 2^n x 2^n parts "
         "with a mask each; and with each block's own direction, as drawn here.",
         {"model", "n"},
         {"culled_percent"},
         {}},
        {"projections",
         "Number of projections (thesis: section 5.1)",
         "",
         {"model", "projections"},
         {"points", "blocks", "build_s", "frame_ms", "psnr_db", "holes"},
         {}},
        {"quality",
         "Coverage, depth threshold and backs with pull and push (thesis: "
         "figures 4.9, 7.2, 7.6)",
         "Against 16 rays a pixel. Models leave no gaps at unit magnification, "
         "so coverage and threshold are shown by points drawn anew on the mesh.",
         {"model", "drawn", "how"},
         {"psnr_db", "flip", "holes", "frame_ms"},
         {}},
        {"shadows",
         "What shadows cost (thesis: figure 7.4)",
         "Suns; the last column is per cent of the frame without shadows, for "
         "each light.",
         {"model", "lights"},
         {"without_ms", "with_ms", "percent_a_light"},
         {}},
    };
    return tables;
}

}  // namespace

std::vector<std::string> blockStudyTables() {
    std::vector<std::string> names;
    for (const StudyTable& table : allTables()) names.push_back(table.name);
    return names;
}

StudyTable blockStudyTable(const std::string& name) {
    const std::vector<StudyTable>& tables = allTables();
    return *std::find_if(tables.begin(), tables.end(),
                         [&](const StudyTable& table) { return table.name == name; });
}

}  // namespace stipple
