// SPDX-License-Identifier: Apache-2.0
// What all commands share in reading their command line: parsing with CLI11, help in one layout,
// and the options that come from the settings table.
#pragma once

#include <core/settings.h>

#include <CLI/CLI.hpp>
#include <list>
#include <string>
#include <vector>

namespace stipple {

// What the commands load.
inline constexpr const char* kSceneFiles = "*.scene.json, .gltf, .glb, .ply, .obj or .stipple";

// The parts of a command's help that its options do not tell.
struct HelpText {
    std::string usage;                  // "stipple info SCENE [--json]"
    std::string summary;                // a few sentences
    std::vector<std::string> examples;  // "stipple info forest.scene.json"
};

// Fills what the app's options are bound to. Prints the help on stdout and returns false if --help
// is among the arguments. Throws kInvalidArgument, for an unknown option with the nearest one that
// exists.
bool parseArguments(CLI::App& app, const HelpText& help, const std::vector<std::string>& arguments);

// "stipple render a.glb -o a.png"
std::string joinCommand(const std::string& command, const std::vector<std::string>& arguments);

// One option for each setting that has one, and --set for all of them.
class SettingOptions {
public:
    // keys: the settings that get an option; empty: all that have one.
    void addTo(CLI::App& app, const std::vector<std::string>& keys = {});
    // Whether the command line sets this key.
    bool sets(const std::string& key) const;
    // Sets what the command line gave: --set first, then the options. Throws kInvalidArgument.
    void apply(RenderSettings& settings) const;

private:
    struct Given {
        std::string key;
        std::string text;
        CLI::Option* option = nullptr;
    };
    std::list<Given> given_;  // a list: CLI11 keeps pointers to the texts
    std::vector<std::string> sets_;
};

// "settings table" as `stipple help settings` prints it.
std::string settingsHelp();

// Breaks text at spaces so that lines have at most `width` characters; every line but the first
// starts with `indent` spaces.
std::string wrapText(const std::string& text, size_t width, size_t indent);

}  // namespace stipple
