// SPDX-License-Identifier: Apache-2.0
// Texts of studies, put into the binary when it is built (from study_texts.cpp.in).
#pragma once

namespace stipple {

extern const char* const kStudySchemaText;    // scenes/studies/study.schema.json
extern const char* const kStandardStudyText;  // scenes/studies/samples-vs-time.study.json
extern const char* const kReportPageText;     // src/tools/study_report.html
extern const char* const kChartLibraryText;   // Chart.js

}  // namespace stipple
