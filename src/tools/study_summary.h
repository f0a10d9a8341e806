// SPDX-License-Identifier: Apache-2.0
// What the rows of a study say: lines of plots with confidence intervals, fits, and which setting
// reaches the quality of how many rays.
#pragma once

#include <tools/study.h>

namespace stipple {

// Median of the repetitions, and the 95 % confidence interval of their mean (equal to the median
// where there is one repetition).
struct StudyValue {
    double value = 0.0, low = 0.0, high = 0.0;
    int count = 0;  // repetitions
};
StudyValue summarize(std::vector<double> values);

struct StudyPoint {
    StudyValue x, y;
    std::string label;  // what the case varies
};

struct StudySeries {
    std::string name;
    bool is_reference = false;
    std::vector<StudyPoint> points;  // by x
};

struct StudyLines {
    const StudyPlot* plot = nullptr;
    std::vector<StudySeries> series;
    std::vector<std::string> notes;  // what fits and curves say
};

// What reaches the quality of a case of a reference sweep, or better, in the least time.
struct StudyAnswer {
    std::string reference;  // "raycast: samples 4"
    std::string camera;
    double psnr = 0.0, seconds = 0.0;  // of the reference
    std::string best;                  // "" if nothing reaches it
    double best_psnr = 0.0, best_seconds = 0.0;
};

struct StudySummary {
    std::vector<StudyLines> lines;
    std::vector<StudyAnswer> answers;
    size_t rows_wanted = 0, rows_there = 0;
    std::string version, machine;
    size_t rows_disturbed = 0;  // times are too long, as other programs took more than
                                // kDisturbedShare of the processors meanwhile
};
inline constexpr double kDisturbedShare = 0.1;

// rows: all that rows.csv holds; those of other studies are left out.
StudySummary summarizeStudy(const Study& study, const std::vector<StudyRow>& rows);

// "samples 4, reconstruct ewa"
std::string caseLabel(const StudyCase& one);

// What changed between two tables beyond noise, as lines of text; json: the same as JSON. Cases
// are matched by their settings. A change counts if Welch's test at 1 % says so and it is larger
// than 2 %.
std::string compareStudies(const std::vector<StudyRow>& before, const std::vector<StudyRow>& after,
                           std::string* json);

}  // namespace stipple
