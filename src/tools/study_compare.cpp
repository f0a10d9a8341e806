// SPDX-License-Identifier: Apache-2.0
// Two tables of studies, before and after: what changed beyond noise.
#include <tools/study_summary.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <set>

namespace stipple {

namespace {

using Json = nlohmann::json;

constexpr double kLeastChange = 0.02;  // relative
// Student's t, two-sided 99 %, by the degrees of freedom of both together.
double studentT99(int freedom) {
    constexpr double kTable[] = {63.66, 9.925, 5.841, 4.604, 4.032,
                                 3.707, 3.499, 3.355, 3.25,  3.169};
    return freedom <= 10 ? kTable[freedom - 1] : 2.576 + 6.5 / freedom;
}

// What tells cases apart: all that was set, but for what belongs to a repetition or a place.
std::string keyOf(const StudyRow& row) {
    std::string key;
    for (const auto& [column, value] : row) {
        static const std::set<std::string> kOwn = {"id",      "repetition",   "seed",
                                                   "scene",   "scene_hash",   "version",
                                                   "machine", "others_share", "finished"};
        if (!isMeasured(column) && !kOwn.count(column)) key += column + " " + value + "\n";
    }
    return key;
}

struct Sample {
    std::vector<double> values;
    double mean() const {
        double sum = 0.0;
        for (const double v : values) sum += v;
        return sum / double(values.size());
    }
    // Of the mean.
    double variance() const {
        if (values.size() < 2) return 0.0;
        const double m = mean();
        double sum = 0.0;
        for (const double v : values) sum += (v - m) * (v - m);
        return sum / double(values.size() - 1) / double(values.size());
    }
};

using Table = std::map<std::string, std::map<std::string, Sample>>;  // key, column

Table tableOf(const std::vector<StudyRow>& rows) {
    Table table;
    for (const StudyRow& row : rows) {
        auto& columns = table[keyOf(row)];
        for (const auto& [column, value] : row) {
            if (isMeasured(column))
                columns[column].values.push_back(std::strtod(value.c_str(), nullptr));
        }
    }
    return table;
}

struct Change {
    std::string name, column;
    double before = 0.0, after = 0.0;
    double relative() const { return after / before - 1.0; }
};

// The keys of the case in which its tables' cases differ: what varies somewhere.
std::string nameOf(const std::string& key,
                   const std::map<std::string, std::set<std::string>>& seen) {
    std::string name;
    size_t begin = 0;
    while (begin < key.size()) {
        const size_t end = key.find('\n', begin), space = key.find(' ', begin);
        const std::string column = key.substr(begin, space - begin);
        if (seen.at(column).size() > 1)
            name += (name.empty() ? "" : ", ") + key.substr(begin, end - begin);
        begin = end + 1;
    }
    return name.empty() ? "the only case" : name;
}

}  // namespace

std::string compareStudies(const std::vector<StudyRow>& before_rows,
                           const std::vector<StudyRow>& after_rows, std::string* json) {
    const Table before = tableOf(before_rows), after = tableOf(after_rows);
    std::map<std::string, std::set<std::string>> seen;
    for (const auto* rows : {&before_rows, &after_rows}) {
        for (const StudyRow& row : *rows) {
            for (const auto& [column, value] : row) seen[column].insert(value);
        }
    }
    std::vector<Change> changes;
    std::vector<double> ratios;  // of later frames
    size_t n_common = 0, n_compared = 0;
    for (const auto& [key, columns] : before) {
        const auto found = after.find(key);
        if (found == after.end()) continue;
        ++n_common;
        for (const auto& [column, old] : columns) {
            const auto now = found->second.find(column);
            if (now == found->second.end()) continue;
            ++n_compared;
            const double a = old.mean(), b = now->second.mean();
            if (column == "later_seconds" && a > 0.0) ratios.push_back(b / a);
            const double change = std::abs(b - a);
            const double least = kLeastChange * std::max(std::abs(a), std::abs(b));
            const int freedom = int(old.values.size() + now->second.values.size()) - 2;
            const double noise =
                freedom < 1
                    ? least
                    : studentT99(freedom) * std::sqrt(old.variance() + now->second.variance());
            if (change > least && change > noise)
                changes.push_back({nameOf(key, seen), column, a, b});
        }
    }
    if (n_common == 0)
        throw Error(ErrorCode::kInvalidArgument, "", "the two studies have no case in common");
    std::sort(changes.begin(), changes.end(), [](const Change& a, const Change& b) {
        return std::abs(a.relative()) > std::abs(b.relative());
    });
    std::sort(ratios.begin(), ratios.end());
    const double ratio = ratios.empty() ? 0.0 : ratios[ratios.size() / 2];

    char line[400];
    std::snprintf(line, sizeof line, "%zu cases in both, %zu only before, %zu only after\n",
                  n_common, before.size() - n_common, after.size() - n_common);
    std::string text = line;
    if (ratio > 0.0) {
        std::snprintf(line, sizeof line,
                      "later frames take %.3f times as long (median of the cases)\n", ratio);
        text += line;
    }
    std::snprintf(line, sizeof line,
                  "%zu of %zu numbers changed by more than 2 %% and beyond noise\n", changes.size(),
                  n_compared);
    text += line;
    Json list = Json::array();
    for (const Change& c : changes) {
        std::snprintf(line, sizeof line, "  %-22s %12.6g -> %12.6g  %+8.1f %%  ", c.column.c_str(),
                      c.before, c.after, 100.0 * c.relative());
        text += line + c.name + "\n";
        list.push_back(
            {{"case", c.name}, {"column", c.column}, {"before", c.before}, {"after", c.after}});
    }
    if (json) {
        *json = Json{{"schema", 1},
                     {"cases", n_common},
                     {"numbers", n_compared},
                     {"later_seconds_ratio", ratio},
                     {"changes", list}}
                    .dump(2) +
                "\n";
    }
    return text;
}

}  // namespace stipple
