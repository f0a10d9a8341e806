// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/load_context.h>

#include <scenegraph/io/json.h>

#include <unistd.h>
#include <cstdio>
#include <fstream>

namespace stipple {

namespace fs = std::filesystem;

namespace {

double physicalMemoryBytes() {
    return double(sysconf(_SC_PHYS_PAGES)) * double(sysconf(_SC_PAGE_SIZE));
}

std::string humanSize(double bytes) {
    const char* unit = "MB";
    double value = bytes / 1e6;
    for (const char* next : {"GB", "TB", "PB", "EB"}) {
        if (value < 1000.0) break;
        value /= 1000.0, unit = next;
    }
    char text[64];
    std::snprintf(text, sizeof text, "%.3g %s", value, unit);
    return text;
}

}  // namespace

MemoryBudget::MemoryBudget(uint64_t limit_mb)
    : limit_bytes_(limit_mb ? double(limit_mb) * 1e6 : 0.8 * physicalMemoryBytes()),
      is_given_(limit_mb != 0) {}

void MemoryBudget::require(double bytes, const std::string& where, const std::string& what) const {
    if (used_bytes_ + bytes <= limit_bytes_) return;
    throw Error(
        ErrorCode::kOutOfMemory, where,
        what + " need about " + humanSize(bytes) + "; " +
            humanSize(std::max(0.0, limit_bytes_ - used_bytes_)) + " are left of " +
            (is_given_ ? "the memory limit of " : "what may be used of this machine's memory, ") +
            humanSize(limit_bytes_));
}

void MemoryBudget::take(double bytes, const std::string& where, const std::string& what) {
    require(bytes, where, what);
    used_bytes_ += bytes;
}

MemoryBudget budgetBeside(const Scene& scene, uint64_t limit_mb) {
    MemoryBudget budget(limit_mb);
    budget.take(double(sceneSize(scene).bytes), scene.path, "the scene's meshes and groups");
    return budget;
}

void LoadContext::warnOnce(const std::string& where, const std::string& message) {
    if (warned.insert(where + '\n' + message).second) diagnostics.warn(where, message);
}

void LoadContext::throwIfCancelled() const {
    if (options.cancel && options.cancel->requested)
        throw Error(ErrorCode::kCancelled, "", "cancelled");
}

fs::path folderOf(const std::string& file) {
    std::error_code error;
    const fs::path canonical = fs::canonical(file, error);
    if (error)
        throw Error(ErrorCode::kFileNotFound, oneLine(file, 300),
                    "cannot be opened: " + error.message());
    return canonical.parent_path();
}

fs::path resolvePath(const LoadContext& context, const fs::path& base, const std::string& relative,
                     const std::string& where) {
    const std::string shown = inQuotes(relative);
    if (relative.empty() || relative.find('\0') != std::string::npos) {
        throw Error(ErrorCode::kFileNotFound, where, shown + " is no file name");
    }
    // Judged before the file is looked for, so that a scene cannot find out what exists elsewhere;
    // and once more with symbolic links resolved.
    const auto refuseOutside = [&](const fs::path& path) {
        if (context.options.allow_outside) return;
        const auto [rest, unused] =
            std::mismatch(context.folder.begin(), context.folder.end(), path.begin(), path.end());
        if (rest != context.folder.end()) {
            throw Error(ErrorCode::kInvalidScene, where,
                        shown + " lies outside of the scene's folder; --allow-outside permits it");
        }
    };
    const fs::path plain = (base / fs::path(relative)).lexically_normal();
    refuseOutside(plain);
    std::error_code error;
    const fs::path canonical = fs::canonical(plain, error);
    if (error)
        throw Error(ErrorCode::kFileNotFound, where,
                    shown + " cannot be opened: " + error.message());
    refuseOutside(canonical);
    return canonical;
}

std::string readFile(const fs::path& path, const MemoryBudget& budget, const std::string& where) {
    std::error_code error;
    if (!fs::is_regular_file(path, error)) {  // a pipe or a device would hang us
        throw Error(ErrorCode::kFileNotFound, where,
                    error ? "cannot be opened: " + error.message() : "is not a file");
    }
    const uintmax_t size = fs::file_size(path, error);
    std::ifstream file(path, std::ios::binary);
    if (error || !file) throw Error(ErrorCode::kFileNotFound, where, "cannot be read");
    budget.require(double(size), where, "the file's bytes");
    std::string bytes(size, '\0');
    file.read(bytes.data(), std::streamsize(size));
    if (uintmax_t(file.gcount()) != size)
        throw Error(ErrorCode::kFileNotFound, where, "cannot be read whole");
    return bytes;
}

}  // namespace stipple
