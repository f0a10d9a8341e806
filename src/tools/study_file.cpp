// SPDX-License-Identifier: Apache-2.0
// The study file, and the standard study.
#include <core/rng.h>
#include <scenegraph/io/json.h>
#include <tools/study.h>
#include <tools/study_texts.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <set>
#include <sstream>

namespace stipple {

namespace {

constexpr size_t kMostCases = 100000;

std::string readText(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    if (!file) throw Error(ErrorCode::kFileNotFound, path, "cannot be read");
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
}

std::string valueText(const Json& value) {
    if (value.is_string()) return value.get<std::string>();
    if (value.is_boolean()) return value.get<bool>() ? "on" : "off";
    return value.dump();
}

uint64_t fingerprint(const std::string& text) {
    uint64_t key = text.size();
    for (const char c : text) key = hashCombine(key, uint8_t(c));
    return key;
}

class Reader {
public:
    explicit Reader(std::string path) : path_(std::move(path)) {}

    Study read(const Json& json) {
        if (const auto problem = JsonSchema(kStudySchemaText).firstProblem(json))
            fail(jsonPointer(problem->path), problem->message);
        Study study;
        study.path = path_;
        const std::filesystem::path scene = json["scene"].get<std::string>();
        study.scene_path =
            (std::filesystem::path(path_).parent_path() / scene).lexically_normal().string();
        study.title = json.value("title", std::filesystem::path(path_).stem().stem().string());
        study.text = json.value("text", "");
        study.repetitions = json.value("repetitions", study.repetitions);
        study.later_frames = json.value("later_frames", study.later_frames);
        study.reference_rays = json.value("reference_rays", study.reference_rays);
        study.pictures = json.value("pictures", study.pictures);
        study.nest_grid = json.value("nest_grid", study.nest_grid);
        StudyCase base;
        base.camera = json.value("camera", "");
        if (json.contains("settings")) applyAll(base, json["settings"], "/settings");
        for (size_t i = 0; i < json["sweeps"].size(); ++i)
            addSweep(study, base, json["sweeps"][i], "/sweeps/" + std::to_string(i));
        for (size_t i = 0; json.contains("plots") && i < json["plots"].size(); ++i)
            addPlot(study, json["plots"][i], "/plots/" + std::to_string(i));
        return study;
    }

private:
    [[noreturn]] void fail(const std::string& place, const std::string& reason) const {
        throw Error(ErrorCode::kInvalidScene, path_ + ": " + place, reason);
    }

    void apply(StudyCase& made, const std::string& key, const Json& value,
               const std::string& place) const {
        const std::string text = valueText(value);
        if (key == "camera") {
            made.camera = text;
        } else if (key == "nest") {
            if (!value.is_number_integer() || value < 0 || value > 24)
                fail(place, "nest is a number of levels, 0..24");
            made.nest = value.get<int>();
        } else if (key == "zoom") {
            if (!value.is_number() || !(value > 0.0) || value > 1e6)
                fail(place, "zoom is a factor above 0");
            made.zoom = value.get<double>();
        } else if (key == "seed") {
            fail(place, "seed is given by the repetition");
        } else {
            try {
                applySetting(made.settings, key, text, "");
            } catch (const Error& error) {
                throw Error(ErrorCode::kInvalidScene, path_ + ": " + place, error.what());
            }
        }
    }

    void applyAll(StudyCase& made, const Json& values, const std::string& place) const {
        for (const auto& [key, value] : values.items()) apply(made, key, value, place + "/" + key);
    }

    void vary(StudyCase& made, StudySweep& sweep, const std::string& key, const Json& value,
              const std::string& place) const {
        apply(made, key, value, place);
        made.varied[key] = valueText(value);
        if (std::find(sweep.keys.begin(), sweep.keys.end(), key) == sweep.keys.end())
            sweep.keys.push_back(key);
    }

    void addSweep(Study& study, StudyCase base, const Json& json, const std::string& place) const {
        StudySweep sweep;
        sweep.name = json["name"].get<std::string>();
        for (const StudySweep& other : study.sweeps) {
            if (other.name == sweep.name)
                fail(place + "/name", "there are two sweeps " + inQuotes(sweep.name));
        }
        const std::string measure = json.value("measure", "frames");
        sweep.measure = measure == "edits"   ? StudyMeasure::kEdits
                        : measure == "cover" ? StudyMeasure::kCover
                                             : StudyMeasure::kFrames;
        sweep.is_reference = json.value("reference", false);
        base.sweep = int(study.sweeps.size());
        if (json.contains("settings")) applyAll(base, json["settings"], place + "/settings");
        std::vector<StudyCase> made = {base};
        const auto multiply = [&](size_t n, const std::function<void(StudyCase&, size_t)>& change) {
            if (study.cases.size() + made.size() * n > kMostCases)
                fail(place, "more than " + std::to_string(kMostCases) + " cases");
            std::vector<StudyCase> more;
            for (const StudyCase& one : made) {
                for (size_t i = 0; i < n; ++i) {
                    more.push_back(one);
                    change(more.back(), i);
                }
            }
            made = std::move(more);
        };
        if (json.contains("cases")) {
            const Json& cases = json["cases"];
            multiply(cases.size(), [&](StudyCase& one, size_t i) {
                for (const auto& [key, value] : cases[i].items())
                    vary(one, sweep, key, value, place + "/cases/" + std::to_string(i) + "/" + key);
            });
        }
        if (json.contains("axes")) {
            for (const auto& [key, values] : json["axes"].items()) {
                multiply(values.size(),
                         [&, &key = key, &values = values](StudyCase& one, size_t i) {
                             vary(one, sweep, key, values[i],
                                  place + "/axes/" + key + "/" + std::to_string(i));
                         });
            }
        }
        study.sweeps.push_back(sweep);
        study.cases.insert(study.cases.end(), made.begin(), made.end());
    }

    // Throws unless there is such a column.
    std::string column(const Json& json, const std::string& place) const {
        const std::string name = json.get<std::string>();
        const std::vector<std::string>& columns = studyColumns();
        if (std::find(columns.begin(), columns.end(), name) == columns.end())
            fail(place, "there is no column " + inQuotes(name) + nameHint(name, columns));
        return name;
    }

    // Whether a column has words, which lie nowhere on an axis.
    static bool isWord(const std::string& column) {
        for (const SettingInfo& info : settingsTable()) {
            if (info.key == column) return info.values.find('|') != std::string::npos;
        }
        const std::set<std::string> words = {"id",    "sweep",  "measure", "version",
                                             "scene", "camera", "machine"};
        return words.count(column) > 0;
    }

    void addPlot(Study& study, const Json& json, const std::string& place) const {
        StudyPlot plot;
        plot.title = json["title"].get<std::string>();
        plot.text = json.value("text", "");
        plot.x = column(json["x"], place + "/x");
        plot.y = column(json["y"], place + "/y");
        for (const auto& [axis, name] : {std::pair("x", plot.x), std::pair("y", plot.y)}) {
            if (isWord(name))
                fail(place + "/" + axis,
                     inQuotes(name) + " is a word, no number; as \"series\" it gives a line each");
        }
        plot.log_x = json.value("x_scale", "linear") == "log";
        plot.log_y = json.value("y_scale", "linear") == "log";
        plot.curve = json.value("curve", "");
        plot.fit = json.value("fit", "");
        if (json.contains("series")) {
            for (size_t i = 0; i < json["series"].size(); ++i)
                plot.series.push_back(
                    column(json["series"][i], place + "/series/" + std::to_string(i)));
        }
        std::vector<std::string> known;
        for (const StudySweep& sweep : study.sweeps) known.push_back(sweep.name);
        plot.sweeps = known;
        if (json.contains("sweeps")) {
            plot.sweeps = json["sweeps"].get<std::vector<std::string>>();
            for (size_t i = 0; i < plot.sweeps.size(); ++i) {
                if (std::find(known.begin(), known.end(), plot.sweeps[i]) == known.end())
                    fail(place + "/sweeps/" + std::to_string(i),
                         "there is no sweep " + inQuotes(plot.sweeps[i]));
            }
        }
        study.plots.push_back(std::move(plot));
    }

    std::string path_;
};

}  // namespace

Study loadStudy(const std::string& path) {
    Study study = Reader(path).read(parseJson(readText(path), path));
    study.scene_fingerprint = fingerprint(readText(study.scene_path));
    return study;
}

Study standardStudy(const std::string& scene_path) {
    Json json = parseJson(kStandardStudyText, "the standard study");
    json["scene"] = std::filesystem::absolute(scene_path).string();
    json["title"] = std::filesystem::path(scene_path).stem().stem().string() +
                    ": samples against time and quality";
    json["text"] =
        "The scene's first camera. Quality (PSNR) is measured against ray casting with many rays a "
        "pixel; rays with 1, 4 and 16 a pixel, and a z-buffer where the scene has no more than "
        "10^9 triangles, are the reference lines.\n\nEach line is one reconstruction and number of "
        "subpixels, its points more and more samples a subpixel.";
    json.erase("camera");
    Study study = Reader("").read(json);
    study.scene_path = scene_path;
    study.scene_fingerprint = fingerprint(readText(scene_path));
    return study;
}

}  // namespace stipple
