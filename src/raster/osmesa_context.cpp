// SPDX-License-Identifier: Apache-2.0
#include <core/error.h>
#include <raster/osmesa_context.h>

#include <GL/osmesa.h>
#include <dlfcn.h>

namespace stipple {

namespace {

template <class Function>
Function* findSymbol(void* handle, const char* name) {
    auto* function = reinterpret_cast<Function*>(dlsym(handle, name));
    if (!function)
        throw Error(ErrorCode::kUnsupported, "libOSMesa", std::string("it has no ") + name);
    return function;
}

// Never unloaded: llvmpipe's threads outlive the context. Local symbols: libOSMesa defines all of
// GL, as a window's libGL does.
void* loadLibrary() {
    std::string reason;
    for (const char* name : {"libOSMesa.so.8", "libOSMesa.so"}) {
        if (void* handle = dlopen(name, RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE)) return handle;
        if (reason.empty()) reason = dlerror();
    }
    throw Error(ErrorCode::kUnsupported, "libOSMesa", reason);
}

}  // namespace

struct OsmesaContext::Library {
    Library() : handle(loadLibrary()) {}
    void* handle;
    decltype(&OSMesaCreateContextAttribs) create =
        findSymbol<decltype(OSMesaCreateContextAttribs)>(handle, "OSMesaCreateContextAttribs");
    decltype(&OSMesaDestroyContext) destroy =
        findSymbol<decltype(OSMesaDestroyContext)>(handle, "OSMesaDestroyContext");
    decltype(&OSMesaMakeCurrent) make_current =
        findSymbol<decltype(OSMesaMakeCurrent)>(handle, "OSMesaMakeCurrent");
    decltype(&OSMesaGetProcAddress) address =
        findSymbol<decltype(OSMesaGetProcAddress)>(handle, "OSMesaGetProcAddress");
};

OsmesaContext::OsmesaContext() : library_(std::make_unique<Library>()) {
    const int attributes[] = {OSMESA_FORMAT,
                              OSMESA_RGBA,
                              OSMESA_DEPTH_BITS,
                              0,
                              OSMESA_STENCIL_BITS,
                              0,
                              OSMESA_PROFILE,
                              OSMESA_CORE_PROFILE,
                              OSMESA_CONTEXT_MAJOR_VERSION,
                              4,
                              OSMESA_CONTEXT_MINOR_VERSION,
                              5,
                              0};
    const auto context = library_->create(attributes, nullptr);
    if (!context)
        throw Error(ErrorCode::kUnsupported, "libOSMesa", "it offers no OpenGL 4.5 core context");
    if (!library_->make_current(context, window_.data(), GL_UNSIGNED_BYTE, 1, 1)) {
        library_->destroy(context);
        throw Error(ErrorCode::kInternal, "libOSMesa", "OSMesaMakeCurrent failed");
    }
    context_ = context;
    const char* missing = nullptr;
#define STIPPLE_GL_LOAD(type, name)                                   \
    gl_.name = reinterpret_cast<type>(library_->address("gl" #name)); \
    if (!gl_.name) missing = "gl" #name;
    STIPPLE_GL_FUNCTIONS(STIPPLE_GL_LOAD)
#undef STIPPLE_GL_LOAD
    if (missing) {
        library_->destroy(context);
        throw Error(ErrorCode::kUnsupported, "libOSMesa", std::string("it has no ") + missing);
    }
}

OsmesaContext::~OsmesaContext() { library_->destroy(static_cast<OSMesaContext>(context_)); }

}  // namespace stipple
