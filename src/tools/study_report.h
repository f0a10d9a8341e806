// SPDX-License-Identifier: Apache-2.0
// What a study shows: as JSON, and as one HTML page that needs nothing else.
#pragma once

#include <tools/study_summary.h>

#include <map>

namespace stipple {

// Schema in docs/studies.md.
std::string studyJson(const Study& study, const StudySummary& summary,
                      const std::vector<StudyRow>& rows);

// A report of any study: the page with that JSON and those pictures (PNG files by id; what cannot
// be read is left out).
std::string reportPage(const std::string& json, const std::map<std::string, std::string>& pictures);

// Plots, pictures (from `folder`/pictures, as data in the page) and tables. Throws kIo.
std::string studyPage(const Study& study, const std::string& json, const std::string& folder);

}  // namespace stipple
