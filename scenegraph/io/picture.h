// SPDX-License-Identifier: Apache-2.0
// Pictures out of memory, through OpenImageIO.
#pragma once

#include <core/material.h>
#include <scenegraph/io/load_context.h>

#include <string>

namespace stipple {

// Decodes a PNG, JPEG or WebP picture into 8-bit RGBA. Throws kParse (not a picture, damaged),
// kUnsupported (another format), kOutOfMemory.
Texture::Level decodePicture(const std::string& bytes, const MemoryBudget& budget,
                             const std::string& where);

// The picture as the bytes of a PNG file. Throws kInternal if it cannot be encoded.
std::string encodePng(const Texture::Level& level);

// Reads a picture file as a texture with mip levels. is_opaque: its alpha has no meaning. Throws as
// above, and as readFile().
Texture readTexture(const std::filesystem::path& file, bool is_srgb, bool is_opaque,
                    LoadContext& context, const std::string& where);
// The same into a new texture of the scene, whose index it returns.
int addTexture(Scene& scene, const std::filesystem::path& file, bool is_srgb, bool is_opaque,
               LoadContext& context, const std::string& where);

}  // namespace stipple
