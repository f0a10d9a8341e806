// SPDX-License-Identifier: Apache-2.0
#include <tools/study_summary.h>

#include <tools/study_run.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

namespace stipple {

namespace {

// Student's t, two-sided 95 %, by degrees of freedom.
double studentT(int freedom) {
    constexpr double kTable[] = {12.71, 4.303, 3.182, 2.776, 2.571,
                                 2.447, 2.365, 2.306, 2.262, 2.228};
    return freedom <= 10 ? kTable[freedom - 1] : 1.96 + 2.5 / freedom;
}

using RowsOfCase = std::vector<const StudyRow*>;

// Of a column, set or measured; empty where rows lack it.
std::vector<double> numbersOf(const RowsOfCase& rows, const std::string& column) {
    std::vector<double> numbers;
    for (const StudyRow* row : rows) {
        const auto found = row->find(column);
        if (found != row->end()) numbers.push_back(std::strtod(found->second.c_str(), nullptr));
    }
    return numbers;
}

struct Line {
    double slope = 0.0, r_squared = 0.0;
};

Line fitLine(const std::vector<double>& x, const std::vector<double>& y) {
    double mx = 0.0, my = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;
    for (size_t i = 0; i < x.size(); ++i)
        mx += x[i] / double(x.size()), my += y[i] / double(x.size());
    for (size_t i = 0; i < x.size(); ++i) {
        xx += (x[i] - mx) * (x[i] - mx);
        xy += (x[i] - mx) * (y[i] - my);
        yy += (y[i] - my) * (y[i] - my);
    }
    if (!(xx > 0.0) || !(yy > 0.0)) return {0.0, 1.0};
    return {xy / xx, xy * xy / (xx * yy)};
}

std::string textOf(const char* format, double value) {
    char text[80];
    std::snprintf(text, sizeof text, format, value);
    return text;
}

void addFit(const StudyPlot& plot, const StudySeries& series, std::vector<std::string>& notes) {
    if (plot.fit.empty() || series.points.size() < 3) return;
    std::vector<double> x, y;
    for (const StudyPoint& p : series.points) {
        const bool is_power = plot.fit == "power";
        if (is_power && !(p.x.value > 0.0 && p.y.value > 0.0)) continue;
        x.push_back(is_power ? std::log(p.x.value) : p.x.value);
        y.push_back(is_power ? std::log(p.y.value) : p.y.value);
    }
    const Line line = fitLine(x, y);
    notes.push_back(series.name + ": " +
                    (plot.fit == "linear" ? textOf("a straight line with R² = %.4f", line.r_squared)
                                          : textOf("grows with the power %.3f", line.slope)));
}

double curveAt(const std::string& curve, double x) {
    return curve == "exp(-x)" ? std::exp(-x) : std::log(x);
}

void addCurve(const StudyPlot& plot, StudyLines& lines) {
    if (plot.curve.empty()) return;
    StudySeries curve;
    curve.name = plot.curve;
    curve.is_reference = true;
    for (const StudySeries& series : lines.series) {
        int inside = 0;
        for (const StudyPoint& p : series.points) {
            const double y = curveAt(plot.curve, p.x.value);
            inside += y >= p.y.low && y <= p.y.high;
            if (curve.points.size() < lines.series.front().points.size())
                curve.points.push_back({p.x, {y, y, y, 0}, ""});
        }
        lines.notes.push_back(series.name + ": " + std::to_string(inside) + " of " +
                              std::to_string(series.points.size()) + " points have " + plot.curve +
                              " within their 95 % confidence interval");
    }
    lines.series.push_back(std::move(curve));
}

}  // namespace

StudyValue summarize(std::vector<double> values) {
    StudyValue result;
    result.count = int(values.size());
    if (values.empty()) return result;
    std::sort(values.begin(), values.end());
    const size_t n = values.size();
    result.value = n % 2 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
    result.low = result.high = result.value;
    if (n < 2) return result;
    double mean = 0.0, squares = 0.0;
    for (const double v : values) mean += v / double(n);
    for (const double v : values) squares += (v - mean) * (v - mean);
    const double half = studentT(int(n) - 1) * std::sqrt(squares / double(n - 1) / double(n));
    result.low = mean - half;
    result.high = mean + half;
    return result;
}

std::string caseLabel(const StudyCase& one) {
    std::string label;
    for (const auto& [key, value] : one.varied)
        label += (label.empty() ? "" : ", ") + key + " " + value;
    return label;
}

StudySummary summarizeStudy(const Study& study, const std::vector<StudyRow>& rows) {
    StudySummary summary;
    std::map<std::string, const StudyRow*> by_id;
    for (const StudyRow& row : rows) by_id[row.at("id")] = &row;
    std::vector<RowsOfCase> of_case(study.cases.size());
    for (size_t c = 0; c < study.cases.size(); ++c) {
        for (int repetition = 0; repetition < study.repetitions; ++repetition) {
            ++summary.rows_wanted;
            const auto found = by_id.find(studyRowId(study, study.cases[c], repetition));
            if (found == by_id.end()) continue;
            ++summary.rows_there;
            of_case[c].push_back(found->second);
            for (const double share : numbersOf({found->second}, "others_share"))
                summary.rows_disturbed += share > kDisturbedShare;
            summary.version = found->second->at("version");
            summary.machine = found->second->at("machine");
        }
    }

    for (const StudyPlot& plot : study.plots) {
        StudyLines& lines = summary.lines.emplace_back();
        lines.plot = &plot;
        for (size_t c = 0; c < study.cases.size(); ++c) {
            const StudyCase& one = study.cases[c];
            const StudySweep& sweep = study.sweeps[size_t(one.sweep)];
            if (std::find(plot.sweeps.begin(), plot.sweeps.end(), sweep.name) == plot.sweeps.end())
                continue;
            const std::vector<double> x = numbersOf(of_case[c], plot.x),
                                      y = numbersOf(of_case[c], plot.y);
            if (x.empty() || y.empty()) continue;
            std::string name = sweep.name;
            for (const std::string& key : plot.series) {
                const auto value = of_case[c].front()->find(key);
                if (value != of_case[c].front()->end())
                    name += (name == sweep.name ? ": " : ", ") + key + " " + value->second;
            }
            auto series = std::find_if(lines.series.begin(), lines.series.end(),
                                       [&](const StudySeries& s) { return s.name == name; });
            if (series == lines.series.end()) {
                lines.series.push_back({name, sweep.is_reference, {}});
                series = lines.series.end() - 1;
            }
            series->points.push_back({summarize(x), summarize(y), caseLabel(one)});
        }
        for (StudySeries& series : lines.series) {
            // Measured times come in any order: their line follows the sweep.
            if (!plot.x.ends_with("_seconds"))
                std::stable_sort(
                    series.points.begin(), series.points.end(),
                    [](const StudyPoint& a, const StudyPoint& b) { return a.x.value < b.x.value; });
            addFit(plot, series, lines.notes);
        }
        if (!lines.series.empty()) addCurve(plot, lines);
    }

    const auto valueOf = [&](size_t c, const char* column) {
        return summarize(numbersOf(of_case[c], column)).value;
    };
    for (size_t r = 0; r < study.cases.size(); ++r) {
        const StudySweep& sweep = study.sweeps[size_t(study.cases[r].sweep)];
        if (!sweep.is_reference || numbersOf(of_case[r], "psnr").empty()) continue;
        StudyAnswer answer;
        const std::string varied = caseLabel(study.cases[r]);
        answer.reference = sweep.name + (varied.empty() ? "" : ": " + varied);
        answer.camera = of_case[r].front()->at("camera");
        answer.psnr = valueOf(r, "psnr");
        answer.seconds = valueOf(r, "later_seconds");
        answer.best_seconds = std::numeric_limits<double>::infinity();
        for (size_t c = 0; c < study.cases.size(); ++c) {
            const StudySweep& own = study.sweeps[size_t(study.cases[c].sweep)];
            if (own.is_reference || numbersOf(of_case[c], "psnr").empty() ||
                studyReferenceId(study, study.cases[c]) != studyReferenceId(study, study.cases[r]))
                continue;
            const double psnr = valueOf(c, "psnr"), seconds = valueOf(c, "later_seconds");
            if (psnr < answer.psnr || seconds >= answer.best_seconds) continue;
            answer.best = own.name + ": " + caseLabel(study.cases[c]);
            answer.best_psnr = psnr;
            answer.best_seconds = seconds;
        }
        if (answer.best.empty()) answer.best_seconds = 0.0;
        summary.answers.push_back(std::move(answer));
    }
    return summary;
}

}  // namespace stipple
