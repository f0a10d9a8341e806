// SPDX-License-Identifier: Apache-2.0
#include <tools/study_run.h>

#include <core/rng.h>
#include <render/compare.h>
#include <render/edit_times.h>
#include <render/renderer.h>
#include <scenegraph/io/load.h>
#include <tools/bench.h>
#include <tools/bench_reference.h>
#include <tools/processor_time.h>
#include <tools/signals.h>
#include <tools/study_scene.h>

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>

namespace stipple {

namespace fs = std::filesystem;

namespace {

constexpr int kEdits = 20000;         // of a row of edit times
constexpr double kCoverStep = 1.03;   // how well the fewest samples are known
constexpr double kMostSamples = 1e4;  // as the settings table has it

uint64_t hashText(uint64_t key, const std::string& text) {
    for (const char c : text) key = hashCombine(key, uint8_t(c));
    return hashCombine(key, text.size());
}

std::string hexText(uint64_t key) {
    char text[20];
    std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(key));
    return text;
}

std::string numberText(double value) {
    char text[40];
    std::snprintf(text, sizeof text, "%.9g", value);
    return text;
}

const char* measureName(StudyMeasure measure) {
    return measure == StudyMeasure::kEdits   ? "edits"
           : measure == StudyMeasure::kCover ? "cover"
                                             : "frames";
}

std::string timeText() {
    const std::time_t now = std::time(nullptr);
    std::tm utc{};
    gmtime_r(&now, &utc);
    char text[40];
    std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc);
    return text;
}

// rows.csv, which grows by whole lines.
class RowFile {
public:
    explicit RowFile(const std::string& path) : path_(path) {
        for (const StudyRow& row : loadRows(path)) done_.insert(row.at("id"));
        std::error_code error;
        if (!fs::exists(path)) {
            append(rowText({}));
            return;
        }
        std::ifstream file(path, std::ios::binary);
        std::string heading;
        std::getline(file, heading);
        if (file.eof()) {  // not even the heading was written
            fs::resize_file(path, 0, error);
            append(rowText({}));
            return;
        }
        if (heading != rowText({})) {
            throw Error(ErrorCode::kParse, path,
                        "was written by another version of stipple; give an empty folder");
        }
        file.seekg(0);
        const std::string text{std::istreambuf_iterator<char>(file), {}};
        fs::resize_file(path, text.rfind('\n') + 1, error);
        if (error) throw Error(ErrorCode::kIo, path, error.message());
    }

    bool has(const std::string& id) const { return done_.count(id) > 0; }

    void add(const StudyRow& row) {
        append(rowText(row));
        done_.insert(row.at("id"));
    }

private:
    void append(const std::string& line) {
        const int file = open(path_.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0666);
        if (file < 0) throw Error(ErrorCode::kIo, path_, std::strerror(errno));
        const std::string text = line + "\n";
        const bool is_written = write(file, text.data(), text.size()) == ssize_t(text.size());
        const int problem = errno;
        close(file);
        if (!is_written) throw Error(ErrorCode::kIo, path_, std::strerror(problem));
    }

    std::string path_;
    std::set<std::string> done_;
};

class StudyRunner {
public:
    StudyRunner(const Study& study, const StudyOptions& options, Scene scene, ThreadPool& pool)
        : study_(study),
          options_(options),
          pool_(pool),
          scene_(std::move(scene), study.nest_grid, pool) {
        for (const int i : picturedCases(study)) pictured_.insert(i);
    }

    void run(RowFile& file) {
        for (const StudyCase& one : study_.cases) scene_.checkCamera(one, study_.path);
        const size_t n = study_.cases.size() * size_t(study_.repetitions);
        size_t done = 0;
        // Repetitions outermost: what drifts on the machine reaches all cases alike.
        for (int repetition = 0; repetition < study_.repetitions; ++repetition) {
            for (size_t c = 0; c < study_.cases.size(); ++c, ++done) {
                const StudyCase& one = study_.cases[c];
                const std::string id = studyRowId(study_, one, repetition);
                if (file.has(id)) continue;
                options_.progress("measure", double(done) / double(n));
                StudyRow row = describe(one, repetition);
                row["id"] = id;
                const ProcessorTime before = processorTime();
                measure(one, repetition, repetition == 0 && pictured_.count(int(c)) > 0, row);
                throwIfCancelled(*options_.cancel);
                row["others_share"] = numberText(othersShare(before, processorTime()));
                row["finished"] = timeText();
                file.add(row);
            }
        }
    }

private:
    StudyRow describe(const StudyCase& one, int repetition) {
        StudyRow row;
        row["sweep"] = study_.sweeps[size_t(one.sweep)].name;
        row["measure"] = measureName(study_.sweeps[size_t(one.sweep)].measure);
        row["camera"] = scene_.camera(one).name;
        row["nest"] = std::to_string(one.nest);
        row["zoom"] = numberText(one.zoom);
        row["repetition"] = std::to_string(repetition);
        row["nest_grid"] = std::to_string(study_.nest_grid);
        row["scene"] = study_.scene_path;
        row["scene_hash"] = hexText(study_.scene_fingerprint);
        row["later_frames"] = std::to_string(study_.later_frames);
        row["reference_rays"] = std::to_string(study_.reference_rays);
        for (const SettingInfo& info : settingsTable())
            row[info.key] = settingValue(one.settings, info.key);
        row["seed"] = std::to_string(repetition + 1);
        const SceneSize size = sceneSize(scene_.atLevel(one.nest));
        row["triangles"] = numberText(size.triangles_total);
        row["instances"] = numberText(size.instances);
        row["version"] = STIPPLE_VERSION;
        row["machine"] = machineName(poolFor(one).threadCount());
        return row;
    }

    ThreadPool& poolFor(const StudyCase& one) {
        std::unique_ptr<ThreadPool>& pool = pools_[one.settings.threads];
        if (!pool) pool = std::make_unique<ThreadPool>(one.settings.threads);
        return *pool;
    }

    FrameRequest request(const StudyCase& one, int repetition) {
        FrameRequest r;
        r.camera = scene_.camera(one);
        r.settings = one.settings;
        r.settings.seed = uint64_t(repetition + 1);
        r.cancel = options_.cancel;
        return r;
    }

    void measure(const StudyCase& one, int repetition, bool with_picture, StudyRow& row) {
        switch (study_.sweeps[size_t(one.sweep)].measure) {
            case StudyMeasure::kFrames:
                return measureFrames(one, repetition, with_picture, row);
            case StudyMeasure::kEdits:
                return measureEditTimes(one, row);
            case StudyMeasure::kCover:
                return measureCover(one, repetition, row);
        }
    }

    void measureFrames(const StudyCase& one, int repetition, bool with_picture, StudyRow& row) {
        // A row without numbers: there is nothing to measure.
        if (one.settings.method == Method::kZBuffer &&
            sceneSize(scene_.atLevel(one.nest)).triangles_total > kZBufferLimit)
            return;
        // The reference first: it must not push out of the processor's caches what later frames
        // find there.
        const Image* reference = study_.reference_rays > 0 ? &referenceFor(one) : nullptr;
        ThreadPool& pool = poolFor(one);
        Renderer renderer(scene_.atLevel(one.nest), pool);
        FrameRequest r = request(one, repetition);
        FrameStats stats = renderer.render(r).stats;
        double first = stats.seconds;
        for (const auto& [name, seconds] : stats.phases) {
            if (name == "build") first += seconds;
        }
        row["first_seconds"] = numberText(first);
        std::map<std::string, std::vector<double>> times;
        for (int i = 0; i < study_.later_frames; ++i) {
            stats = renderer.render(r).stats;
            times["later"].push_back(stats.seconds);
            for (const auto& [name, seconds] : stats.phases) times[name].push_back(seconds);
        }
        const auto put = [&](const char* column, const char* name) {
            if (!times[name].empty()) row[column] = numberText(median(times[name]));
        };
        put("later_seconds", "later");
        put("plan_seconds", "plan");
        put("draw_seconds", "draw");
        put("reconstruct_seconds", "reconstruct");
        r.aovs = {"depth", "coverage", "count"};
        const Image image = renderer.render(r).image;
        const double pixels = double(image.width) * image.height;
        const double subpixels = double(one.settings.subpixels) * one.settings.subpixels;
        row["points_drawn"] = numberText(double(stats.points_drawn));
        row["points_kept"] = numberText(double(stats.points_kept));
        row["points_per_pixel"] = numberText(double(stats.points_drawn) / pixels);
        if (stats.points_kept > 0) row["overestimation"] = numberText(stats.overestimation);
        if (one.settings.method == Method::kPoints) {
            row["projected_pixels"] =
                numberText(double(stats.points_kept) / (one.settings.samples * subpixels));
        }
        row["batches"] = numberText(double(stats.batches));
        row["large_triangles"] = numberText(double(stats.large_triangles));
        row["small_triangles"] = numberText(double(stats.small_triangles));
        row["cache_bytes"] = numberText(double(stats.cache_bytes));
        const Coverage covered = coverageOf(image);
        row["visible_pixels"] = numberText(covered.sum);
        row["empty"] = numberText(double(covered.empty) / pixels);
        if (reference) {
            const CompareResult quality = compareImages(image, *reference, pool);
            row["psnr"] = numberText(std::min(quality.psnr, 200.0));
            row["flip"] = numberText(quality.flip);
            if (quality.holes) row["holes"] = numberText(quality.holes->fraction);
        }
        if (with_picture) {
            const std::string path = studyPicturePath(options_.folder, row.at("id"));
            fs::create_directories(fs::path(path).parent_path());
            saveImage(image, path);
            const std::string reference_path =
                studyPicturePath(options_.folder, studyReferenceId(study_, one));
            if (reference && !fs::exists(reference_path)) saveImage(*reference, reference_path);
        }
    }

    struct Coverage {
        double sum = 0.0;
        size_t empty = 0;  // pixels without a point (rays: that hit nothing)
    };
    static Coverage coverageOf(const Image& image) {
        const int coverage = image.channelIndex("coverage"), count = image.channelIndex("count");
        Coverage covered;
        for (int y = 0; y < image.height; ++y) {
            for (int x = 0; x < image.width; ++x) {
                const float* pixel = image.pixel(x, y);
                covered.sum += double(pixel[coverage]);
                covered.empty += !(pixel[count] > 0.0f);
            }
        }
        return covered;
    }

    void measureEditTimes(const StudyCase& one, StudyRow& row) {
        const Scene scene = scene_.inOneGroup(one.nest);
        row["instances"] = numberText(sceneSize(scene).instances);
        row["triangles"] = numberText(sceneSize(scene).triangles_total);
        const EditTimes times = measureEdits(scene, kEdits, false, poolFor(one));
        row["insert_us"] = numberText(times.insert.median * 1e6);
        row["move_us"] = numberText(times.move.median * 1e6);
        row["remove_us"] = numberText(times.remove.median * 1e6);
    }

    // Nothing is filled, and all pixels are to be hit: of the surface that fills the picture.
    void measureCover(const StudyCase& one, int repetition, StudyRow& row) {
        Renderer renderer(scene_.atLevel(one.nest), poolFor(one));
        FrameRequest r = request(one, repetition);
        r.aovs = {"coverage", "count"};
        r.settings.fill = false;
        double none = 0.0, all = 0.5;  // samples that do not suffice, and that do
        const auto covers = [&](double k) {
            r.settings.samples = k;
            const Frame frame = renderer.render(r);
            throwIfCancelled(*options_.cancel);
            const Coverage covered = coverageOf(frame.image);
            if (covered.empty > 0) return false;
            row["samples_needed"] = numberText(k);
            row["visible_pixels"] = numberText(covered.sum);
            row["points_drawn"] = numberText(double(frame.stats.points_drawn));
            row["points_kept"] = numberText(double(frame.stats.points_kept));
            return true;
        };
        while (all <= kMostSamples && !covers(all)) {
            none = all;
            all *= 1.4;
        }
        while (all <= kMostSamples && all > none * kCoverStep) {
            const double middle = 0.5 * (none + all);
            (covers(middle) ? all : none) = middle;
        }
        if (row.count("samples_needed")) return;
        throw Error(ErrorCode::kInvalidScene, study_.scene_path,
                    "has no surface that fills the picture: nothing covers it");
    }

    const Image& referenceFor(const StudyCase& one) {
        const std::string key = studyReferenceId(study_, one);
        const auto found = references_.find(key);
        if (found != references_.end()) return found->second;
        Renderer renderer(scene_.atLevel(one.nest), pool_);
        FrameRequest r = request(one, 0);
        Reference made =
            loadOrCastReference(renderer, r, study_.reference_rays,
                                [&](double fraction) { options_.progress("reference", fraction); });
        references_.clear();  // one at a time: cases with the same view follow each other
        return references_[key] = std::move(made.image);
    }

    const Study& study_;
    const StudyOptions& options_;
    ThreadPool& pool_;
    StudyScene scene_;
    std::set<int> pictured_;
    std::map<int, std::unique_ptr<ThreadPool>> pools_;
    std::map<std::string, Image> references_;
};

}  // namespace

std::string machineName(int threads) {
    std::ifstream file("/proc/cpuinfo");
    std::string name = "unknown processor";
    for (std::string line; std::getline(file, line);) {
        if (!line.starts_with("model name")) continue;
        name = line.substr(std::min(line.size(), line.find(':') + 2));
        break;
    }
    return name + ", " + std::to_string(threads) + " threads";
}

std::string studyRowId(const Study& study, const StudyCase& one, int repetition) {
    uint64_t key = hashText(1, study.sweeps[size_t(one.sweep)].name);
    key = hashText(key, measureName(study.sweeps[size_t(one.sweep)].measure));
    key = hashCombine(key, study.scene_fingerprint);
    key = hashText(key, one.camera);
    key = hashCombine(key, uint64_t(one.nest), uint64_t(study.nest_grid));
    key = hashText(key, numberText(one.zoom));
    for (const SettingInfo& info : settingsTable()) {
        if (info.key == "seed") continue;
        key = hashText(key, info.key);
        key = hashText(key, settingValue(one.settings, info.key));
    }
    key = hashCombine(key, uint64_t(study.later_frames));
    return hexText(hashCombine(key, uint64_t(repetition), uint64_t(study.reference_rays)));
}

std::string studyReferenceId(const Study& study, const StudyCase& one) {
    uint64_t key = hashCombine(2, study.scene_fingerprint);
    key = hashText(key, one.camera);
    key = hashCombine(key, uint64_t(one.nest), uint64_t(one.settings.width),
                      uint64_t(one.settings.height));
    key = hashText(key, numberText(one.zoom) + (one.settings.shadows ? " shadows" : ""));
    for (const char* setting : {"exposure", "ao", "ao_radius", "ao_rays"})
        key = hashText(key, settingValue(one.settings, setting));
    key = hashCombine(key, uint64_t(study.nest_grid));
    return "reference-" + hexText(hashCombine(key, uint64_t(study.reference_rays)));
}

std::string studyPicturePath(const std::string& folder, const std::string& id) {
    return (fs::path(folder) / "pictures" / (id + ".png")).string();
}

std::vector<int> picturedCases(const Study& study) {
    std::vector<int> all, chosen;
    for (size_t c = 0; c < study.cases.size(); ++c) {
        if (study.sweeps[size_t(study.cases[c].sweep)].measure == StudyMeasure::kFrames)
            all.push_back(int(c));
    }
    const size_t n = std::min(all.size(), size_t(study.pictures));
    for (size_t i = 0; i < n; ++i) chosen.push_back(all[i * all.size() / n]);
    return chosen;
}

void runStudy(const Study& study, const StudyOptions& options, Diagnostics& diagnostics) {
    std::error_code error;
    fs::create_directories(options.folder, error);
    if (error) throw Error(ErrorCode::kIo, options.folder, error.message());
    RowFile file((fs::path(options.folder) / "rows.csv").string());
    bool is_done = true;
    for (int repetition = 0; repetition < study.repetitions; ++repetition) {
        for (const StudyCase& one : study.cases)
            is_done = is_done && file.has(studyRowId(study, one, repetition));
    }
    if (is_done) return;
    options.progress("load", 0.0);
    ThreadPool pool(options.threads);
    const LoadOptions load_options = {options.allow_outside, 0, options.cancel};
    Scene scene = loadScene(study.scene_path, load_options, pool, diagnostics);
    throwIfCancelled(*options.cancel);
    StudyRunner(study, options, std::move(scene), pool).run(file);
}

}  // namespace stipple
