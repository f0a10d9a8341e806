// SPDX-License-Identifier: Apache-2.0
// What a study shows: as JSON, and as one HTML page that needs nothing else.
#pragma once

#include <tools/study_summary.h>

namespace stipple {

// Schema in docs/studies.md.
std::string studyJson(const Study& study, const StudySummary& summary,
                      const std::vector<StudyRow>& rows);

// Plots, pictures (from `folder`/pictures, as data in the page) and tables. Throws kIo.
std::string studyPage(const Study& study, const std::string& json, const std::string& folder);

}  // namespace stipple
