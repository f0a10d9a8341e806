// SPDX-License-Identifier: Apache-2.0
// Measures what a study asks for, row by row, and goes on where an earlier run stopped.
#pragma once

#include <core/error.h>
#include <core/parallel.h>
#include <tools/study.h>

#include <functional>

namespace stipple {

struct StudyOptions {
    std::string folder;  // rows.csv and pictures/ come here
    bool allow_outside = false;
    int threads = 0;  // for loading; cases have their own setting
    const CancelFlag* cancel = nullptr;
    std::function<void(const std::string& phase, double fraction)> progress;
};

// The processor, and how many threads: for tables.
std::string machineName(int threads);

// The row of a case and a repetition: what is the same whenever it is measured.
std::string studyRowId(const Study& study, const StudyCase& one, int repetition);

// Pictures of a study, beside rows.csv.
std::string studyPicturePath(const std::string& folder, const std::string& id);
// The cases that get a picture, by index: evenly among those that draw frames.
std::vector<int> picturedCases(const Study& study);
// Of what the case is judged by.
std::string studyReferenceId(const Study& study, const StudyCase& one);

// Appends the rows that DIR/rows.csv lacks, each whole or not at all. Throws kCancelled; what has
// been measured stays. Other errors as loading and rendering throw, and kParse for a foreign
// rows.csv.
void runStudy(const Study& study, const StudyOptions& options, Diagnostics& diagnostics);

}  // namespace stipple
