// SPDX-License-Identifier: Apache-2.0
// Entry point of the `stipple` program: finds the command, turns errors into one line on stderr and
// an exit code.
#include <core/nearest_name.h>
#include <tools/commands.h>

#include <cstdio>
#include <exception>
#include <iostream>
#include <new>

namespace stipple {

ExitCode exitCodeOf(ErrorCode code) {
    switch (code) {
        case ErrorCode::kInvalidArgument:
            return ExitCode::kUsage;
        case ErrorCode::kFileNotFound:
        case ErrorCode::kParse:
        case ErrorCode::kInvalidScene:
        case ErrorCode::kUnsupported:
            return ExitCode::kInput;
        case ErrorCode::kCancelled:
            return ExitCode::kInterrupted;
        case ErrorCode::kOutOfMemory:
        case ErrorCode::kIo:
        case ErrorCode::kInternal:
            break;
    }
    return ExitCode::kFailed;
}

const std::vector<Command>& commandTable() {
    static const std::vector<Command> table = {
        {"render", "draw a picture of a scene", runRender},
        {"info", "say what is in a scene", runInfo},
        {"compare", "measure how much two pictures differ", runCompare},
        {"bench", "measure points beside rays and the z-buffer", runBench},
        {"edit", "change a scene line by line, and look at it", runEditScene},
        {"view", "look around in a window, and edit", runView},
        {"study", "sweep settings and sizes, and report", runStudyCommand},
        {"build", "make models of points", runBuild},
        {"generate", "make trees, rocks, terrains, forests and landscapes", runGenerate},
        {"help", "explain a command, or list the settings", runHelp},
    };
    return table;
}

const Command& findCommand(const std::string& name) {
    std::vector<std::string> names;
    for (const Command& command : commandTable()) {
        if (command.name == name) return command;
        names.push_back(command.name);
    }
    const std::string nearest = nearestName(name, names);
    throw Error(
        ErrorCode::kInvalidArgument, "",
        "unknown command '" + name + "'" +
            (nearest.empty() ? "; try 'stipple help'" : "; did you mean '" + nearest + "'?"));
}

std::string shortUsage() {
    std::string text = "Usage: stipple COMMAND ...\n\nCommands:\n";
    for (const Command& command : commandTable()) {
        text += "  " + command.name + std::string(10 - command.name.size(), ' ') + command.summary +
                "\n";
    }
    return text + "\n'stipple help COMMAND' or 'stipple COMMAND --help' says more.\n";
}

void printMessage(std::string message) {
    for (char& c : message) {
        if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = ' ';
    }
    std::fprintf(stderr, "stipple: %s\n", message.c_str());
}

namespace {

ExitCode runCommand(const std::vector<std::string>& arguments) {
    if (arguments.empty()) {
        std::cerr << shortUsage();
        return ExitCode::kUsage;
    }
    const std::string& name = arguments[0];
    if (name == "--help" || name == "-h") return runHelp({});
    if (name == "--version") {
        std::cout << "stipple " STIPPLE_VERSION "\n";
        return ExitCode::kDone;
    }
    return findCommand(name).run({arguments.begin() + 1, arguments.end()});
}

}  // namespace

}  // namespace stipple

int main(int argc, char** argv) {
    using stipple::ExitCode;
    ExitCode code = ExitCode::kFailed;
    try {
        code = stipple::runCommand({argv + 1, argv + argc});
        std::cout.flush();
        if (!std::cout || std::fflush(stdout) != 0) {
            throw stipple::Error(stipple::ErrorCode::kIo, "", "cannot write to standard output");
        }
    } catch (const stipple::Error& error) {
        stipple::printMessage(error.what());
        code = stipple::exitCodeOf(error.code());
    } catch (const std::bad_alloc&) {
        stipple::printMessage("out of memory");
        code = ExitCode::kFailed;
    } catch (const std::exception& error) {
        stipple::printMessage(error.what());
        code = ExitCode::kFailed;
    }
    return int(code);
}
