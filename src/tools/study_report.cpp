// SPDX-License-Identifier: Apache-2.0
#include <tools/study_report.h>

#include <tools/study_run.h>
#include <tools/study_texts.h>

#include <nlohmann/json.hpp>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>

namespace stipple {

namespace {

using Json = nlohmann::ordered_json;

Json valueJson(const StudyValue& v) { return Json::array({v.value, v.low, v.high}); }

Json plotJson(const StudyLines& lines) {
    const StudyPlot& plot = *lines.plot;
    Json series = Json::array();
    for (const StudySeries& s : lines.series) {
        Json points = Json::array();
        for (const StudyPoint& p : s.points) {
            points.push_back({{"x", valueJson(p.x)},
                              {"y", valueJson(p.y)},
                              {"repetitions", p.y.count},
                              {"label", p.label}});
        }
        series.push_back(
            {{"name", s.name}, {"reference", s.is_reference}, {"points", std::move(points)}});
    }
    return {{"title", plot.title},
            {"text", plot.text},
            {"x", {{"column", plot.x}, {"label", columnLabel(plot.x)}, {"log", plot.log_x}}},
            {"y", {{"column", plot.y}, {"label", columnLabel(plot.y)}, {"log", plot.log_y}}},
            {"series", std::move(series)},
            {"notes", lines.notes}};
}

std::string base64(const std::string& bytes) {
    static const char* kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    for (size_t i = 0; i < bytes.size(); i += 3) {
        uint32_t v = 0;
        for (size_t k = 0; k < 3; ++k)
            v = v << 8 | (i + k < bytes.size() ? uint8_t(bytes[i + k]) : 0);
        for (int k = 0; k < 4; ++k)
            text += i + size_t(k) <= bytes.size() ? kDigits[v >> (18 - 6 * k) & 63] : '=';
    }
    return text;
}

std::string readBytes(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

void replaceAll(std::string& text, const std::string& what, const std::string& by) {
    for (size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + by.size()))
        text.replace(at, what.size(), by);
}

}  // namespace

std::string studyJson(const Study& study, const StudySummary& summary,
                      const std::vector<StudyRow>& rows) {
    Json plots = Json::array(), answers = Json::array(), table = Json::array();
    for (const StudyLines& lines : summary.lines) plots.push_back(plotJson(lines));
    for (const StudyAnswer& a : summary.answers) {
        Json answer = {{"reference", a.reference},
                       {"camera", a.camera},
                       {"psnr", a.psnr},
                       {"seconds", a.seconds}};
        if (!a.best.empty()) {
            answer["best"] = a.best;
            answer["best_psnr"] = a.best_psnr;
            answer["best_seconds"] = a.best_seconds;
        }
        answers.push_back(answer);
    }
    // Rows with what they vary and what was measured; the rest is in rows.csv.
    std::set<std::string> varied;
    for (const StudyCase& one : study.cases) {
        for (const auto& [key, value] : one.varied) varied.insert(key);
    }
    for (const StudyRow& row : rows) {
        Json entry = {
            {"id", row.at("id")}, {"sweep", row.at("sweep")}, {"repetition", row.at("repetition")}};
        for (const std::string& column : studyColumns()) {
            const auto value = row.find(column);
            if (value != row.end() && (varied.count(column) || isMeasured(column)))
                entry[column] = value->second;
        }
        table.push_back(std::move(entry));
    }
    Json settings = Json::object();
    for (const SettingInfo& info : settingsTable()) {
        std::set<std::string> values;
        for (const StudyCase& one : study.cases)
            values.insert(settingValue(one.settings, info.key));
        if (info.key != "seed" && values.size() == 1) settings[info.key] = *values.begin();
    }
    Json pictures = Json::array();
    for (const int c : picturedCases(study)) {
        const StudyCase& one = study.cases[size_t(c)];
        const std::string label = caseLabel(one);
        pictures.push_back({{"id", studyRowId(study, one, 0)},
                            {"reference", studyReferenceId(study, one)},
                            {"label", study.sweeps[size_t(one.sweep)].name +
                                          (label.empty() ? "" : ": " + label)}});
    }
    return Json{{"schema", 1},
                {"title", study.title},
                {"text", study.text},
                {"scene", study.scene_path},
                {"version", summary.version},
                {"machine", summary.machine},
                {"repetitions", study.repetitions},
                {"later_frames", study.later_frames},
                {"reference_rays", study.reference_rays},
                {"rows",
                 {{"wanted", summary.rows_wanted},
                  {"there", summary.rows_there},
                  {"disturbed", summary.rows_disturbed}}},
                {"settings", std::move(settings)},
                {"varied", varied},
                {"answers", std::move(answers)},
                {"plots", std::move(plots)},
                {"pictures", std::move(pictures)},
                {"table", std::move(table)}}
               .dump(1) +
           "\n";
}

std::string reportPage(const std::string& json,
                       const std::map<std::string, std::string>& pictures) {
    std::string images = "{";
    for (const auto& [id, path] : pictures) {
        const std::string bytes = readBytes(path);
        if (bytes.empty()) continue;
        images += (images.size() > 1 ? ",\n" : "") + ("\"" + id + "\":\"data:image/png;base64,") +
                  base64(bytes) + "\"";
    }
    images += "}";
    std::string data = json;
    replaceAll(data, "<", "\\u003c");  // no text of a study ends the script
    std::string page = kReportPageText;
    replaceAll(page, "/*CHART_LIBRARY*/", kChartLibraryText);
    replaceAll(page, "/*STUDY*/null", data);
    replaceAll(page, "/*IMAGES*/{}", images);
    return page;
}

std::string studyPage(const Study& study, const std::string& json, const std::string& folder) {
    std::map<std::string, std::string> pictures;
    for (const int c : picturedCases(study)) {
        const StudyCase& one = study.cases[size_t(c)];
        for (const std::string& id : {studyRowId(study, one, 0), studyReferenceId(study, one)})
            pictures[id] = studyPicturePath(folder, id);
    }
    return reportPage(json, pictures);
}

}  // namespace stipple
