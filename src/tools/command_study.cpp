// SPDX-License-Identifier: Apache-2.0
// `stipple study`: sweeps, as a table, as JSON and as a report.
#include <core/image.h>
#include <tools/block_study.h>
#include <tools/command_line.h>
#include <tools/commands.h>
#include <tools/output_file.h>
#include <tools/progress.h>
#include <tools/signals.h>
#include <tools/study_report.h>
#include <tools/study_run.h>

#include <cstdio>
#include <filesystem>
#include <iostream>

namespace stipple {

namespace {

const HelpText kHelp = {
    "stipple study STUDY.study.json|SCENE|--point-blocks ASSET... -o DIR [--json FILE]",
    "Measures pictures over settings, scene sizes and cameras, and shows what came out: "
    "DIR/report.html (plots, pictures, tables; one file that needs no network), DIR/rows.csv (a "
    "row a measurement, with all that is needed to repeat it) and DIR/pictures. A study that was "
    "interrupted goes on where it stopped. With a scene instead of a study, samples against time "
    "and quality are measured, beside rays. --point-blocks measures models of points made of "
    "files: DIR/*.csv has sizes, phases, what is culled and more, a table each. --compare tells "
    "what changed between two studies beyond noise.",
    {"stipple study scenes/studies/samples-vs-time.study.json -o out/study",
     "stipple study tree.glb -o out/tree-study",
     "stipple study --point-blocks dragon.glb oak.glb -o out/point-blocks",
     "stipple study --compare out/before out/after"}};

std::string rowsPath(const std::string& folder) {
    return (std::filesystem::path(folder) / "rows.csv").string();
}

std::vector<StudyRow> rowsOf(const std::string& folder) {
    std::vector<StudyRow> rows = loadRows(rowsPath(folder));
    if (rows.empty())
        throw Error(ErrorCode::kFileNotFound, rowsPath(folder), "holds no rows of a study");
    return rows;
}

ExitCode runCompareStudies(const std::vector<std::string>& folders, const std::string& json_path) {
    std::string json;
    const std::string text = compareStudies(rowsOf(folders[0]), rowsOf(folders[1]), &json);
    if (!json_path.empty()) saveFile(json_path, json);
    std::cout << text;
    return ExitCode::kDone;
}

void studyPointBlocks(BlockStudyOptions options, bool quiet, const std::string& json_path) {
    std::error_code error;
    std::filesystem::create_directories(options.folder, error);
    if (error) throw Error(ErrorCode::kIo, options.folder, error.message());
    Progress progress(quiet);
    options.cancel = &cancelOnSignals();
    options.progress = [&](const std::string& phase, double fraction) {
        progress.update(phase, fraction);
    };
    Diagnostics diagnostics;
    const std::vector<StudyTable> tables = runBlockStudy(options, diagnostics);
    progress.finish();
    for (const std::string& warning : diagnostics.warnings) printMessage("warning: " + warning);
    const std::filesystem::path folder(options.folder);
    for (const StudyTable& table : tables)
        saveFile((folder / (table.name + ".csv")).string(), tableCsv(table));
    const std::string text = blockStudyJson(tables, options);
    if (!json_path.empty()) saveFile(json_path, text);
    const std::string report = (folder / "report.html").string();
    saveFile(report, blockStudyPage(text, options));
    std::cout << report << "\n";
}

void printAnswers(const StudySummary& summary) {
    if (summary.rows_disturbed > 0) {
        std::printf(
            "other programs took more than a tenth of the processors during %zu of %zu rows: their "
            "times are too long (rows.csv: others_share)\n",
            summary.rows_disturbed, summary.rows_there);
    }
    for (const StudyAnswer& a : summary.answers) {
        std::printf("%s (%.2f dB, %.3f s): ", a.reference.c_str(), a.psnr, a.seconds);
        if (a.best.empty()) {
            std::printf("nothing reaches it\n");
        } else {
            std::printf("%s (%.2f dB, %.3f s), %.2f times as fast\n", a.best.c_str(), a.best_psnr,
                        a.best_seconds, a.seconds / a.best_seconds);
        }
    }
    for (const StudyLines& lines : summary.lines) {
        for (const std::string& note : lines.notes)
            std::printf("%s: %s\n", lines.plot->title.c_str(), note.c_str());
    }
}

}  // namespace

ExitCode runStudyCommand(const std::vector<std::string>& arguments) {
    CLI::App app;
    std::string input, json;
    StudyOptions options;
    std::vector<std::string> compared;
    BlockStudyOptions blocks;
    bool quiet = false;
    app.add_option("STUDY", input, "*.study.json, or a scene or model for the standard study")
        ->group("Arguments");
    app.add_option("-o,--output", options.folder, "folder of the results; made if missing")
        ->type_name("DIR")
        ->group("Results");
    app.add_option("--json", json, "write the plots' numbers, or those of --compare, as JSON")
        ->type_name("FILE")
        ->group("Results");
    app.add_option("--compare", compared, "two folders of results: say what changed beyond noise")
        ->type_name("BEFORE AFTER")
        ->expected(2)
        ->group("Results");
    app.add_option("--point-blocks", blocks.assets,
                   "models and scenes to make models of points of, and to measure these")
        ->type_name("ASSET...")
        ->group("Point blocks");
    app.add_option("--resolution", blocks.resolution,
                   "pixels along these models, and along their pictures (default 256)")
        ->type_name("N")
        ->check(CLI::Range(16, 1024).description(""))
        ->group("Point blocks");
    app.add_option("--tables", blocks.tables, "measure these alone, separated by commas")
        ->type_name("NAME...")
        ->delimiter(',')
        ->check(CLI::IsMember(blockStudyTables()).description(""))
        ->group("Point blocks");
    app.add_flag("--allow-outside", options.allow_outside, "let the scene's paths leave its folder")
        ->group("Running");
    app.add_flag("-q,--quiet", quiet, "no progress, only warnings and errors")->group("Running");
    if (!parseArguments(app, kHelp, arguments)) return ExitCode::kDone;
    if (!json.empty()) checkOutputFile("--json", json, {});
    if (!compared.empty()) {
        if (!input.empty() || !options.folder.empty())
            throw Error(ErrorCode::kInvalidArgument, "--compare", "takes two folders and no study");
        return runCompareStudies(compared, json);
    }
    if (!blocks.assets.empty()) {
        if (!input.empty())
            throw Error(ErrorCode::kInvalidArgument, "--point-blocks", "takes models and no study");
        if (options.folder.empty())
            throw Error(ErrorCode::kInvalidArgument, "--output", "is required");
        blocks.folder = options.folder;
        blocks.allow_outside = options.allow_outside;
        studyPointBlocks(blocks, quiet, json);
        return ExitCode::kDone;
    }
    for (const char* option : {"--resolution", "--tables"}) {
        if (app.count(option))
            throw Error(ErrorCode::kInvalidArgument, option, "needs --point-blocks");
    }
    if (input.empty()) throw Error(ErrorCode::kInvalidArgument, "", "STUDY is required");
    if (options.folder.empty()) throw Error(ErrorCode::kInvalidArgument, "--output", "is required");

    const bool is_study = input.ends_with(".study.json");
    const Study study = is_study ? loadStudy(input) : standardStudy(input);
    const CancelFlag& cancel = cancelOnSignals();
    Progress progress(quiet);
    options.cancel = &cancel;
    options.progress = [&](const std::string& phase, double fraction) {
        progress.update(phase, fraction);
    };
    Diagnostics diagnostics;
    runStudy(study, options, diagnostics);
    progress.finish();
    for (const std::string& warning : diagnostics.warnings) printMessage("warning: " + warning);

    const std::vector<StudyRow> rows = loadRows(rowsPath(options.folder));
    const StudySummary summary = summarizeStudy(study, rows);
    const std::string text = studyJson(study, summary, rows);
    const std::string report = (std::filesystem::path(options.folder) / "report.html").string();
    saveFile(report, studyPage(study, text, options.folder));
    if (!json.empty()) saveFile(json, text);
    printAnswers(summary);
    std::cout << report << "\n";
    return ExitCode::kDone;
}

}  // namespace stipple
