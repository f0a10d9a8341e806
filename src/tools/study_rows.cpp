// SPDX-License-Identifier: Apache-2.0
// The table of a study: its columns, and its file.
#include <core/error.h>
#include <tools/study.h>

#include <algorithm>
#include <fstream>
#include <sstream>

namespace stipple {

namespace {

struct Measured {
    const char* column;
    const char* label;
};

constexpr Measured kMeasured[] = {
    {"first_seconds", "seconds, first frame"},
    {"later_seconds", "seconds a frame, later frames"},
    {"plan_seconds", "seconds of planning, later frames"},
    {"draw_seconds", "seconds of drawing, later frames"},
    {"reconstruct_seconds", "seconds of reconstruction and shading, later frames"},
    {"psnr", "PSNR, dB"},
    {"flip", "FLIP"},
    {"holes", "share of pixels that are holes"},
    {"empty", "share of pixels without any point"},
    {"points_drawn", "points drawn"},
    {"points_kept", "points kept"},
    {"points_per_pixel", "points drawn a pixel"},
    {"overestimation", "points drawn for each that is kept"},
    {"batches", "batches"},
    {"large_triangles", "triangles in the z-buffer"},
    {"small_triangles", "triangles rasterized in tiles"},
    {"cache_bytes", "bytes of point lists"},
    {"visible_pixels", "pixels that show something"},
    {"projected_pixels", "projected area of what was drawn, pixels"},
    {"instances", "instances"},
    {"triangles", "triangles of the expanded scene"},
    {"samples_needed", "samples a pixel until no pixel is empty"},
    {"insert_us", "microseconds to insert an instance"},
    {"move_us", "microseconds to move an instance"},
    {"remove_us", "microseconds to remove an instance"},
};

std::vector<std::string> makeColumns() {
    std::vector<std::string> columns = {
        "id",   "sweep", "measure",    "camera",     "nest",         "nest_grid",
        "zoom", "scene", "scene_hash", "repetition", "later_frames", "reference_rays"};
    for (const SettingInfo& info : settingsTable()) columns.push_back(info.key);
    for (const Measured& m : kMeasured) columns.push_back(m.column);
    for (const char* by : {"version", "machine", "others_share", "finished"}) columns.push_back(by);
    return columns;
}

std::string quoted(const std::string& text) {
    if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
    std::string result = "\"";
    for (const char c : text) {
        if (c == '"') result += '"';
        result += c == '\n' || c == '\r' ? ' ' : c;
    }
    return result + "\"";
}

std::vector<std::string> splitLine(const std::string& line) {
    std::vector<std::string> fields(1);
    bool in_quotes = false;
    for (size_t i = 0; i < line.size(); ++i) {
        const char c = line[i];
        if (in_quotes) {
            if (c == '"' && i + 1 < line.size() && line[i + 1] == '"') {
                fields.back() += '"';
                ++i;
            } else if (c == '"') {
                in_quotes = false;
            } else {
                fields.back() += c;
            }
        } else if (c == '"') {
            in_quotes = true;
        } else if (c == ',') {
            fields.emplace_back();
        } else {
            fields.back() += c;
        }
    }
    return fields;
}

}  // namespace

const std::vector<std::string>& studyColumns() {
    static const std::vector<std::string> columns = makeColumns();
    return columns;
}

bool isMeasured(const std::string& column) {
    return std::any_of(std::begin(kMeasured), std::end(kMeasured),
                       [&](const Measured& m) { return column == m.column; });
}

std::string columnLabel(const std::string& column) {
    for (const Measured& m : kMeasured) {
        if (column == m.column) return m.label;
    }
    if (column == "samples") return "samples (points a subpixel, or rays a pixel)";
    if (column == "nest") return "levels of nesting";
    for (const SettingInfo& info : settingsTable()) {
        if (info.key == column && !info.unit.empty()) return column + ", " + info.unit;
    }
    return column;
}

std::string rowText(const StudyRow& row) {
    std::string text;
    for (const std::string& column : studyColumns()) {
        const auto found = row.find(column);
        text += (text.empty() ? "" : ",") + (row.empty()          ? column
                                             : found == row.end() ? ""
                                                                  : quoted(found->second));
    }
    return text;
}

std::vector<StudyRow> loadRows(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    if (!file) return {};
    std::ostringstream buffer;
    buffer << file.rdbuf();
    std::string text = buffer.str();
    text.resize(text.rfind('\n') == std::string::npos ? 0 : text.rfind('\n') + 1);
    std::istringstream lines(text);
    std::string line;
    std::vector<std::string> columns;
    std::vector<StudyRow> rows;
    for (int number = 1; std::getline(lines, line); ++number) {
        const std::vector<std::string> fields = splitLine(line);
        if (columns.empty()) {
            columns = fields;
            if (columns[0] != "id")
                throw Error(ErrorCode::kParse, path, "is not the table of a study");
            continue;
        }
        if (fields.size() != columns.size()) {
            throw Error(ErrorCode::kParse, path + ": line " + std::to_string(number),
                        "has " + std::to_string(fields.size()) + " fields, not " +
                            std::to_string(columns.size()));
        }
        StudyRow& row = rows.emplace_back();
        for (size_t i = 0; i < fields.size(); ++i) {
            if (!fields[i].empty()) row[columns[i]] = fields[i];
        }
    }
    return rows;
}

}  // namespace stipple
