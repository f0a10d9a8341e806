// SPDX-License-Identifier: Apache-2.0
// Studies: sweeps over settings, scene size and camera; what is measured, and what is made of it.
#pragma once

#include <core/settings.h>

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace stipple {

enum class StudyMeasure { kFrames, kEdits, kCover };

// One place of a sweep: what is measured, repetitions aside.
struct StudyCase {
    int sweep = 0;  // index into Study::sweeps
    std::map<std::string, std::string>
        varied;               // what the sweep gives: settings, camera, nest, zoom
    RenderSettings settings;  // with the study's and the sweep's
    std::string camera;       // "": the first of the scene
    int nest = 0;             // levels of copies
    double zoom = 1.0;        // factor of the focal length
};

struct StudySweep {
    std::string name;
    StudyMeasure measure = StudyMeasure::kFrames;
    bool is_reference = false;
    std::vector<std::string> keys;  // that vary
};

struct StudyPlot {
    std::string title, text, x, y;
    std::vector<std::string> sweeps, series;
    bool log_x = false, log_y = false;
    std::string curve, fit;
};

struct Study {
    std::string path;  // of the study file; "" for the standard study of a scene
    std::string title, text;
    std::string scene_path;
    uint64_t scene_fingerprint = 0;  // of the scene file's text: other content, other rows
    int repetitions = 3;
    int later_frames = 2;
    int reference_rays = 0;
    int pictures = 12;
    int nest_grid = 4;
    std::vector<StudySweep> sweeps;
    std::vector<StudyCase> cases;
    std::vector<StudyPlot> plots;
};

inline constexpr const char* kFitCamera = "fit";

// Reads a study file. Throws kFileNotFound, kParse, kInvalidScene with the JSON pointer.
Study loadStudy(const std::string& path);
// The standard study of a scene: samples against time and quality.
Study standardStudy(const std::string& scene_path);

// One measured row: text by column.
using StudyRow = std::map<std::string, std::string>;

// The columns of rows.csv in order: what was set, then what was measured, then by what.
const std::vector<std::string>& studyColumns();
// Whether a column is a measured number.
bool isMeasured(const std::string& column);
// What a column is called on an axis: "seconds a frame, later frames".
std::string columnLabel(const std::string& column);

// Rows of a CSV file as saved, an incomplete last line left out. Empty if there is no file. Throws
// kParse for a file that is no table of a study.
std::vector<StudyRow> loadRows(const std::string& path);
// One line for the file, without line break; the heading for an empty row.
std::string rowText(const StudyRow& row);

}  // namespace stipple
