// SPDX-License-Identifier: Apache-2.0
// A GL 4.5 core context without a window, on the CPU: OSMesa, loaded at run time.
#pragma once

#include <raster/gl.h>

#include <array>
#include <memory>

namespace stipple {

// Make, use and destroy it on one thread: it stays current there. Throws Error(kUnsupported) with
// the loader's words if there is no libOSMesa or it has no GL 4.5.
class OsmesaContext {
public:
    OsmesaContext();
    ~OsmesaContext();
    OsmesaContext(const OsmesaContext&) = delete;
    OsmesaContext& operator=(const OsmesaContext&) = delete;

    const Gl& gl() const { return gl_; }

private:
    struct Library;
    std::unique_ptr<Library> library_;
    void* context_ = nullptr;
    std::array<unsigned char, 4> window_{};  // OSMesa insists on a pixel to draw to
    Gl gl_;
};

}  // namespace stipple
