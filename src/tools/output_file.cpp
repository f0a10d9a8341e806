// SPDX-License-Identifier: Apache-2.0
#include <core/error.h>
#include <tools/output_file.h>

#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <filesystem>

namespace stipple {

namespace fs = std::filesystem;

std::string lowerExtension(const std::string& path) {
    std::string extension = fs::path(path).extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](unsigned char c) { return char(std::tolower(c)); });
    return extension;
}

void checkOutputFile(const std::string& option, const std::string& path,
                     const std::vector<std::string>& extensions) {
    if (path.starts_with("-"))
        throw Error(ErrorCode::kInvalidArgument, option, "needs a file, got '" + path + "'");
    const bool known =
        std::find(extensions.begin(), extensions.end(), lowerExtension(path)) != extensions.end();
    if (!extensions.empty() && !known) {
        std::string list;
        for (const std::string& extension : extensions)
            list += (list.empty() ? "" : " or ") + extension;
        throw Error(ErrorCode::kInvalidArgument, option, "'" + path + "' must end in " + list);
    }
    std::error_code error;
    const fs::path parent = fs::path(path).parent_path();
    const fs::path folder = parent.empty() ? fs::path(".") : parent;
    if (!fs::is_directory(folder, error)) {
        throw Error(ErrorCode::kIo, path, "there is no folder '" + folder.string() + "'");
    }
    if (access(folder.c_str(), W_OK | X_OK) != 0) {
        throw Error(ErrorCode::kIo, path, "cannot write to the folder '" + folder.string() + "'");
    }
    // Files are written beside their place and then renamed, which would replace a device or a
    // pipe.
    if (fs::exists(path, error) && !fs::is_regular_file(path, error)) {
        throw Error(ErrorCode::kIo, path, "exists and is not a regular file");
    }
}

}  // namespace stipple
