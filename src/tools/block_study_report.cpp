// SPDX-License-Identifier: Apache-2.0
#include <tools/block_study.h>
#include <tools/study_report.h>
#include <tools/study_run.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

namespace stipple {

namespace {

using Json = nlohmann::ordered_json;

std::string nameOf(const std::string& asset) {
    return std::filesystem::path(asset).stem().string();
}

std::string numberText(double value) {
    char text[40];
    std::snprintf(text, sizeof text, "%.6g", value);
    return text;
}

Json tableJson(const StudyTable& table) {
    Json rows = Json::array();
    for (const StudyTableRow& row : table.rows) {
        Json cells = Json::array();
        for (const std::string& label : row.labels) cells.push_back(label);
        for (const double value : row.values) cells.push_back(value);
        rows.push_back(std::move(cells));
    }
    return {{"name", table.name},     {"title", table.title},   {"text", table.text},
            {"labels", table.labels}, {"values", table.values}, {"rows", std::move(rows)}};
}

// Means over the models: a line for each kind of row, over the last label where it is a number.
Json plotJson(const StudyTable& table, const std::string& kind, const std::string& x,
              const std::string& value, const std::string& y) {
    const size_t column =
        size_t(std::find(table.values.begin(), table.values.end(), value) - table.values.begin());
    std::map<std::string, std::map<double, double>> lines;
    for (const StudyTableRow& row : table.rows) {
        const std::string& at = row.labels.back();
        const std::string name = row.labels.size() > 2 ? row.labels[1] : "mean";
        double number = 0.0;
        const auto [rest, error] = std::from_chars(at.data(), at.data() + at.size(), number);
        if (row.labels[0] != "mean" || !name.starts_with(kind) || error != std::errc()) continue;
        lines[name][number] = row.values[column];
    }
    Json series = Json::array();
    for (const auto& [name, points] : lines) {
        Json list = Json::array();
        for (const auto& [at, v] : points) {
            list.push_back({{"x", Json::array({at, at, at})},
                            {"y", Json::array({v, v, v})},
                            {"repetitions", 1},
                            {"label", ""}});
        }
        series.push_back({{"name", name}, {"reference", false}, {"points", std::move(list)}});
    }
    return {{"title", y + " over " + x},
            {"text", ""},
            {"x", {{"column", x}, {"label", x}, {"log", false}}},
            {"y", {{"column", value}, {"label", y}, {"log", false}}},
            {"series", std::move(series)},
            {"notes", Json::array()}};
}

}  // namespace

std::string tableCsv(const StudyTable& table) {
    std::string text;
    const auto add = [&](const std::string& cell) {
        const bool is_quoted = cell.find_first_of(",\"") != std::string::npos;
        if (!text.empty() && text.back() != '\n') text += ',';
        text += is_quoted ? "\"" + cell + "\"" : cell;
    };
    for (const std::string& label : table.labels) add(label);
    for (const std::string& value : table.values) add(value);
    text += '\n';
    for (const StudyTableRow& row : table.rows) {
        for (const std::string& label : row.labels) add(label);
        for (const double value : row.values) add(numberText(value));
        text += '\n';
    }
    return text;
}

std::string blockStudyJson(const std::vector<StudyTable>& tables,
                           const BlockStudyOptions& options) {
    Json list = Json::array(), plots = Json::array(), pictures = Json::array();
    for (const StudyTable& table : tables) {
        list.push_back(tableJson(table));
        if (table.name == "sizes") {
            for (const char* kind : {"tolerance angle", "block size"}) {
                plots.push_back(plotJson(table, kind, kind, "size", "size, relative"));
                plots.push_back(
                    plotJson(table, kind, kind, "draw_time", "time of drawing points, relative"));
            }
        }
        if (table.name == "screen")
            plots.push_back(plotJson(table, "mean", "n", "culled_percent", "% of blocks culled"));
    }
    std::string names;
    for (const std::string& asset : options.assets) {
        names += (names.empty() ? "" : ", ") + nameOf(asset);
        pictures.push_back({{"id", nameOf(asset) + ".points"},
                            {"reference", nameOf(asset) + ".rays"},
                            {"reference_label", nameOf(asset) + ", one ray a pixel"},
                            {"label", nameOf(asset) + ", points"}});
    }
    return Json{{"schema", 1},
                {"title", "Point-block models"},
                {"text",
                 "The tables and figures of Grossman's Point Sample Rendering (1998), measured of "
                 "these models, " +
                     std::to_string(options.resolution) +
                     " pixels wide. Frames are drawn by one thread; the fastest counts."},
                {"scene", names},
                {"version", STIPPLE_VERSION},
                {"machine", machineName(1)},
                {"repetitions", kBlockStudyFrames},
                {"reference_rays", 0},
                {"varied", Json::array()},
                {"rows", {{"wanted", 0}, {"there", 0}}},
                {"settings", Json::object()},
                {"answers", Json::array()},
                {"plots", std::move(plots)},
                {"pictures", std::move(pictures)},
                {"table", Json::array()},
                {"tables", std::move(list)}}
               .dump(1) +
           "\n";
}

std::string blockStudyPage(const std::string& json, const BlockStudyOptions& options) {
    std::map<std::string, std::string> pictures;
    for (const std::string& asset : options.assets) {
        for (const char* kind : {".points", ".rays"}) {
            const std::string id = nameOf(asset) + kind;
            pictures[id] =
                (std::filesystem::path(options.folder) / "pictures" / (id + ".png")).string();
        }
    }
    return reportPage(json, pictures);
}

}  // namespace stipple
