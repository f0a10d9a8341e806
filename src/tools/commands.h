// SPDX-License-Identifier: Apache-2.0
// The commands of `stipple`: one function and one file each. They take the arguments behind the
// command's name, print results on stdout, throw Error for all that goes wrong, and return what the
// shell shall see.
#pragma once

#include <tools/exit_code.h>

#include <string>
#include <vector>

namespace stipple {

ExitCode runRender(const std::vector<std::string>& arguments);
ExitCode runInfo(const std::vector<std::string>& arguments);
ExitCode runCompare(const std::vector<std::string>& arguments);
ExitCode runBench(const std::vector<std::string>& arguments);
ExitCode runEditScene(const std::vector<std::string>& arguments);
ExitCode runView(const std::vector<std::string>& arguments);
ExitCode runStudyCommand(const std::vector<std::string>& arguments);
ExitCode runBuild(const std::vector<std::string>& arguments);
ExitCode runGenerate(const std::vector<std::string>& arguments);
ExitCode runHelp(const std::vector<std::string>& arguments);

struct Command {
    std::string name;
    std::string summary;
    ExitCode (*run)(const std::vector<std::string>& arguments);
};
const std::vector<Command>& commandTable();

// Throws kInvalidArgument naming the nearest command.
const Command& findCommand(const std::string& name);

// Prints "stipple: message" as one line on stderr, whatever a file name or a library has put into
// it.
void printMessage(std::string message);

// The few lines that `stipple` alone and `stipple help` print.
std::string shortUsage();

}  // namespace stipple
