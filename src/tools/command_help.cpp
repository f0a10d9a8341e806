// SPDX-License-Identifier: Apache-2.0
#include <tools/command_line.h>
#include <tools/commands.h>

#include <iostream>

namespace stipple {

ExitCode runHelp(const std::vector<std::string>& arguments) {
    CLI::App app;
    std::string topic;
    app.add_option("TOPIC", topic, "a command, or 'settings'")->group("Arguments");
    const HelpText help = {
        "stipple help [settings|COMMAND]",
        "Explains a command, or lists all settings with their values and defaults.",
        {"stipple help render", "stipple help settings"}};
    if (!parseArguments(app, help, arguments)) return ExitCode::kDone;
    if (topic.empty()) {
        std::cout << shortUsage();
    } else if (topic == "settings") {
        std::cout << settingsHelp();
    } else {
        return findCommand(topic).run({"--help"});
    }
    return ExitCode::kDone;
}

}  // namespace stipple
