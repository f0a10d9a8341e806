// SPDX-License-Identifier: Apache-2.0
#include <tools/bench_process.h>

#include <nlohmann/json.hpp>

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <thread>

namespace stipple {

namespace {

// A folder that is gone with its owner.
class TemporaryFolder {
public:
    TemporaryFolder() {
        std::string name = (std::filesystem::temp_directory_path() / "stipple-XXXXXX").string();
        if (!mkdtemp(name.data())) throw Error(ErrorCode::kIo, name, std::strerror(errno));
        path_ = name;
    }
    ~TemporaryFolder() {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;
    std::string file(const char* name) const { return (path_ / name).string(); }

private:
    std::filesystem::path path_;
};

// Exit status of this program, run with `arguments`; stdout is thrown away, stderr goes to a file.
int runSelf(std::vector<std::string> arguments, const std::string& stderr_path,
            const CancelFlag& cancel) {
    const std::string self = std::filesystem::read_symlink("/proc/self/exe").string();
    std::vector<char*> argv{const_cast<char*>(self.c_str())};
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, stderr_path.c_str(),
                                     O_WRONLY | O_CREAT, 0600);
    pid_t pid = 0;
    const int error = posix_spawn(&pid, "/proc/self/exe", &actions, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) throw Error(ErrorCode::kInternal, self, std::strerror(error));
    int status = 0;
    while (waitpid(pid, &status, WNOHANG) == 0) {
        if (cancel.requested) {
            kill(pid, SIGKILL);
            waitpid(pid, &status, 0);
            throw Error(ErrorCode::kCancelled, "", "interrupted");
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

std::string lastLine(const std::string& path) {
    std::ifstream file(path);
    std::string last;
    for (std::string line; std::getline(file, line);) last = line;
    return last;
}

}  // namespace

ColdStart runColdStart(const BenchOptions& options, const std::string& camera,
                       const RenderSettings& settings, const CancelFlag& cancel) {
    const TemporaryFolder folder;
    const std::string stats_path = folder.file("stats.json");
    std::vector<std::string> arguments = {"render",  options.scene_path,       "--quiet",
                                          "-o",      folder.file("frame.exr"), "--stats",
                                          stats_path};
    if (!camera.empty()) arguments.insert(arguments.end(), {"--camera", camera});
    if (options.allow_outside) arguments.push_back("--allow-outside");
    for (const SettingInfo& info : settingsTable()) {
        arguments.insert(arguments.end(),
                         {"--set", info.key + "=" + settingValue(settings, info.key)});
    }
    const std::string stderr_path = folder.file("stderr.txt");
    const int code = runSelf(arguments, stderr_path, cancel);
    if (cancel.requested) throw Error(ErrorCode::kCancelled, "", "interrupted");
    if (code != 0) {
        throw Error(ErrorCode::kInternal, "stipple render",
                    code < 0 ? "was killed" : "failed: " + lastLine(stderr_path));
    }
    std::ifstream file(stats_path);
    const nlohmann::json stats = nlohmann::json::parse(file, nullptr, false);
    if (stats.is_discarded())
        throw Error(ErrorCode::kInternal, "stipple render", "left no valid --stats");
    ColdStart cold;
    for (const nlohmann::json& phase : stats.at("phases")) {
        if (phase.at("name") == "load") cold.load_seconds = phase.at("seconds");
        if (phase.at("name") == "build") cold.build_seconds = phase.at("seconds");
    }
    cold.frame_seconds = stats.at("frames").at(0);
    cold.picture_seconds = cold.build_seconds + cold.frame_seconds;
    cold.total_seconds = cold.load_seconds + cold.picture_seconds;
    cold.peak_bytes = stats.at("memory").at("peak_bytes");
    return cold;
}

}  // namespace stipple
