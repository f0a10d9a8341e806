// SPDX-License-Identifier: Apache-2.0
// The study of point-block models: the tables and figures of Grossman's Point Sample Rendering
// (1998), measured of models given.
#pragma once

#include <core/error.h>
#include <core/parallel.h>

#include <functional>
#include <string>
#include <vector>

namespace stipple {

inline constexpr int kBlockStudyFrames = 16;  // of a view; the fastest counts

struct BlockStudyOptions {
    std::vector<std::string> assets;  // files of scenes and models
    std::string folder;               // exists; models/ and pictures/ come here
    int resolution = 256;             // of models, and pixels along a side of pictures
    std::vector<std::string> tables;  // of blockStudyTables(); none: all
    bool allow_outside = false;
    const CancelFlag* cancel = nullptr;
    std::function<void(const std::string& phase, double fraction)> progress;
};

struct StudyTableRow {
    std::vector<std::string> labels;
    std::vector<double> values;
};

struct StudyTable {
    std::string name;                         // of its file
    std::string title, text;                  // text: what was done, and what the thesis has
    std::vector<std::string> labels, values;  // what columns are called
    std::vector<StudyTableRow> rows;
};

// Names of all tables, and one of them without rows.
std::vector<std::string> blockStudyTables();
StudyTable blockStudyTable(const std::string& name);

// Builds and draws models; frames are drawn by one thread. Throws as loading, building and
// rendering do, and kInvalidArgument for assets of the same name.
std::vector<StudyTable> runBlockStudy(const BlockStudyOptions& options, Diagnostics& diagnostics);

// Rows of a table with its heading, for a file.
std::string tableCsv(const StudyTable& table);
// Schema in docs/studies.md.
std::string blockStudyJson(const std::vector<StudyTable>& tables, const BlockStudyOptions& options);
// One file that needs no network: plots, tables, pictures.
std::string blockStudyPage(const std::string& json, const BlockStudyOptions& options);

}  // namespace stipple
