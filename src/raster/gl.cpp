// SPDX-License-Identifier: Apache-2.0
#include <core/error.h>
#include <raster/gl.h>

namespace stipple {

namespace {

std::string errorName(GLenum error) {
    switch (error) {
        case GL_INVALID_ENUM:
            return "GL_INVALID_ENUM";
        case GL_INVALID_VALUE:
            return "GL_INVALID_VALUE";
        case GL_INVALID_OPERATION:
            return "GL_INVALID_OPERATION";
        case GL_INVALID_FRAMEBUFFER_OPERATION:
            return "GL_INVALID_FRAMEBUFFER_OPERATION";
        case GL_OUT_OF_MEMORY:
            return "GL_OUT_OF_MEMORY";
        default:
            return "GL error " + std::to_string(error);
    }
}

}  // namespace

void Gl::check(const std::string& where) const {
    const GLenum error = GetError();
    if (error == GL_NO_ERROR) return;
    // A context may hold several; the first tells what went wrong. Bounded: a lost context reports
    // for ever.
    for (int i = 0; i < 16 && GetError() != GL_NO_ERROR; ++i) {
    }
    throw Error(error == GL_OUT_OF_MEMORY ? ErrorCode::kOutOfMemory : ErrorCode::kInternal,
                "rasterizer: " + where, errorName(error));
}

GLuint Gl::makeProgram(const std::string& vertex_source, const std::string& fragment_source) const {
    const GLuint program = CreateProgram();
    char log[4096] = "";
    GLint ok = GL_FALSE;
    for (const bool vertex : {true, false}) {
        const GLuint shader = CreateShader(vertex ? GL_VERTEX_SHADER : GL_FRAGMENT_SHADER);
        const char* source = vertex ? vertex_source.c_str() : fragment_source.c_str();
        ShaderSource(shader, 1, &source, nullptr);
        CompileShader(shader);
        GetShaderiv(shader, GL_COMPILE_STATUS, &ok);
        if (!ok) {
            GetShaderInfoLog(shader, sizeof(log), nullptr, log);
            throw Error(ErrorCode::kInternal,
                        vertex ? "rasterizer: vertex shader" : "rasterizer: fragment shader", log);
        }
        AttachShader(program, shader);
        DeleteShader(shader);
    }
    LinkProgram(program);
    GetProgramiv(program, GL_LINK_STATUS, &ok);
    if (!ok) {
        GetProgramInfoLog(program, sizeof(log), nullptr, log);
        throw Error(ErrorCode::kInternal, "rasterizer: program", log);
    }
    return program;
}

GLint Gl::integer(GLenum name) const {
    GLint value = 0;
    GetIntegerv(name, &value);
    return value;
}

}  // namespace stipple
