// SPDX-License-Identifier: Apache-2.0
// What all loaders share while one scene is loaded: the folder that files may come from, the memory
// left, warnings and the cancel flag.
#pragma once

#include <scenegraph/io/load.h>

#include <filesystem>
#include <set>
#include <string>

namespace stipple {

// Counts what loading keeps, in advance, so that a hostile file is refused before memory is gone.
class MemoryBudget {
public:
    // limit_mb: 0 for 80 % of the machine's memory.
    explicit MemoryBudget(uint64_t limit_mb);

    // Throws kOutOfMemory unless `bytes` more fit; what: "10000 triangles". The bytes are not
    // counted as used.
    void require(double bytes, const std::string& where, const std::string& what) const;
    // The same, and counts them.
    void take(double bytes, const std::string& where, const std::string& what);

private:
    double limit_bytes_;
    double used_bytes_ = 0.0;
    bool is_given_;
};

// What building from a scene may take beside it. Throws kOutOfMemory if the scene alone is too
// large.
MemoryBudget budgetBeside(const Scene& scene, uint64_t limit_mb);

// Estimates of what one costs once built, with the transient costs of building it.
inline constexpr double kBytesPerInstance = 110.0;
inline constexpr double kBytesPerTriangle = 80.0;
inline constexpr double kBytesPerVertex = 48.0;

struct LoadContext {
    LoadContext(const LoadOptions& o, Diagnostics& d, std::filesystem::path f,
                ThreadPool* p = nullptr)
        : options(o), diagnostics(d), folder(std::move(f)), budget(o.memory_limit_mb), pool(p) {}

    const LoadOptions& options;
    Diagnostics& diagnostics;
    std::filesystem::path
        folder;  // canonical; files must lie below it unless options.allow_outside
    MemoryBudget budget;
    ThreadPool* pool;              // for long loops; nullptr: none
    std::set<std::string> warned;  // warnings given, so that each is given once

    void warnOnce(const std::string& where, const std::string& message);
    void throwIfCancelled() const;
};

// The folder of `file` as LoadContext::folder wants it. Throws kFileNotFound.
std::filesystem::path folderOf(const std::string& file);

// The regular file that `relative` (UTF-8, seen from `base`) names, with symbolic links resolved.
// Throws kFileNotFound, or kInvalidScene if it lies outside of context.folder and that is not
// allowed.
std::filesystem::path resolvePath(const LoadContext& context, const std::filesystem::path& base,
                                  const std::string& relative, const std::string& where);

// The whole file. Throws kFileNotFound if it is none, cannot be read or is not a regular file;
// kOutOfMemory.
std::string readFile(const std::filesystem::path& path, const MemoryBudget& budget,
                     const std::string& where);

}  // namespace stipple
