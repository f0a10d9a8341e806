// SPDX-License-Identifier: Apache-2.0
#include <core/nearest_name.h>
#include <tools/command_line.h>

#include <algorithm>
#include <iostream>
#include <sstream>

namespace stipple {

namespace {

constexpr size_t kHelpWidth = 80;
constexpr size_t kHelpIndent = 30;

std::string dashed(std::string key) {
    std::replace(key.begin(), key.end(), '_', '-');
    return "--" + key;
}

bool isChoice(const SettingInfo& info) { return info.values.find("..") == std::string::npos; }

// "width of the picture (pixels, 1..65536; default 1280)"
std::string describe(const SettingInfo& info, bool with_choices) {
    std::string text = info.help + " (";
    if (!info.unit.empty()) text += info.unit + ", ";
    if (with_choices || !isChoice(info)) text += info.values + "; ";
    return text + "default " + settingValue(RenderSettings{}, info.key) + ")";
}

std::string helpLine(const std::string& name, const std::string& description) {
    std::string line = "  " + name;
    line += line.size() + 2 > kHelpIndent ? "\n" + std::string(kHelpIndent, ' ')
                                          : std::string(kHelpIndent - line.size(), ' ');
    return line + wrapText(description, kHelpWidth - kHelpIndent, kHelpIndent) + "\n";
}

void printHelp(const CLI::App& app, const HelpText& help) {
    std::ostream& out = std::cout;
    out << "Usage: " << help.usage << "\n\n" << wrapText(help.summary, kHelpWidth, 0) << "\n";
    for (const std::string& group : app.get_groups()) {
        const auto options = app.get_options(
            [&](const CLI::Option* option) { return option->get_group() == group; });
        if (options.empty()) continue;
        out << "\n" << group << ":\n";
        for (const CLI::Option* option : options) {
            std::string name =
                option->get_positional() ? option->get_name() : option->get_name(false, true);
            std::replace(name.begin(), name.end(), ',', ' ');
            if (!option->get_positional() && !option->get_type_name().empty()) {
                name += " " + option->get_type_name();
            }
            out << helpLine(name, option->get_description());
        }
    }
    out << "\nExamples:\n";
    for (const std::string& example : help.examples) out << "  " << example << "\n";
}

// The first argument that no option took, as an error.
Error unexpectedArgument(const CLI::App& app, const std::string& argument) {
    if (argument.empty() || argument[0] != '-') {
        return Error(ErrorCode::kInvalidArgument, "", "unexpected argument '" + argument + "'");
    }
    const std::string name = argument.substr(0, argument.find('='));
    std::vector<std::string> names;
    for (const CLI::Option* option : app.get_options()) {
        for (const std::string& known : option->get_lnames()) names.push_back("--" + known);
    }
    const std::string nearest = nearestName(name, names);
    return Error(
        ErrorCode::kInvalidArgument, "",
        "unknown option '" + name + "'" +
            (nearest.empty() ? "; --help lists them" : "; did you mean '" + nearest + "'?"));
}

}  // namespace

bool parseArguments(CLI::App& app, const HelpText& help,
                    const std::vector<std::string>& arguments) {
    app.set_help_flag("-h,--help", "print this text");
    try {
        std::vector<std::string> last_first(arguments.rbegin(), arguments.rend());
        app.parse(last_first);
    } catch (const CLI::CallForHelp&) {
        printHelp(app, help);
        return false;
    } catch (const CLI::ParseError& error) {
        // why: a misspelt option is also what makes CLI11 miss a required one; name the cause.
        const std::vector<std::string> unexpected = app.remaining();
        if (!unexpected.empty()) throw unexpectedArgument(app, unexpected[0]);
        const std::string message = error.what();
        if (dynamic_cast<const CLI::ArgumentMismatch*>(&error)) {
            throw Error(ErrorCode::kInvalidArgument, message.substr(0, message.find(':')),
                        "takes exactly one value");
        }
        throw Error(ErrorCode::kInvalidArgument, "", message);
    }
    return true;
}

std::string joinCommand(const std::string& command, const std::vector<std::string>& arguments) {
    std::string line = "stipple " + command;
    for (const std::string& argument : arguments) line += " " + argument;
    return line;
}

void SettingOptions::addTo(CLI::App& app, const std::vector<std::string>& keys) {
    for (const SettingInfo& info : settingsTable()) {
        if (!info.has_option) continue;
        if (!keys.empty() && std::find(keys.begin(), keys.end(), info.key) == keys.end()) continue;
        Given& given = given_.emplace_back();
        given.key = info.key;
        given.option = app.add_option(dashed(info.key), given.text, describe(info, false))
                           ->type_name(isChoice(info) ? info.values : "N")
                           ->group("Settings");
    }
    app.add_option("--set", sets_,
                   "any setting by its name; 'stipple help settings' lists them; repeatable")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false)
        ->group("Settings");
}

bool SettingOptions::sets(const std::string& key) const {
    for (const std::string& set : sets_) {
        if (set.substr(0, set.find('=')) == key) return true;
    }
    return std::any_of(given_.begin(), given_.end(), [&](const Given& given) {
        return given.key == key && given.option->count() > 0;
    });
}

void SettingOptions::apply(RenderSettings& settings) const {
    for (const std::string& set : sets_) {
        const size_t equals = set.find('=');
        if (equals == std::string::npos) {
            throw Error(ErrorCode::kInvalidArgument, "--set", "'" + set + "' is not KEY=VALUE");
        }
        applySetting(settings, set.substr(0, equals), set.substr(equals + 1), "--set");
    }
    for (const Given& given : given_) {
        if (given.option->count() > 0)
            applySetting(settings, given.key, given.text, dashed(given.key));
    }
}

std::string settingsHelp() {
    std::string text =
        "Settings, for --set KEY=VALUE and for \"render\" in a scene file. The scene file "
        "overrides\n"
        "the defaults, the command line overrides the scene file.\n\n";
    for (const SettingInfo& info : settingsTable()) {
        text += helpLine(info.key, describe(info, true));
    }
    return text;
}

std::string wrapText(const std::string& text, size_t width, size_t indent) {
    std::istringstream words(text);
    std::string result, word;
    size_t column = 0;
    while (words >> word) {
        if (column > 0 && column + 1 + word.size() > width) {
            result += "\n" + std::string(indent, ' ');
            column = 0;
        } else if (column > 0) {
            result += ' ';
            ++column;
        }
        result += word;
        column += word.size();
    }
    return result;
}

}  // namespace stipple
