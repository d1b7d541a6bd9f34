// How edges of bodies are drawn.

export const LINES = {
  vertex: `#version 300 es
    in vec3 position;
    uniform mat4 modelViewMatrix; uniform mat4 projectionMatrix;
    void main() {
      gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
      gl_Position.z -= 0.0004 * gl_Position.w; // before the faces that they bound
    }`,
  fragment: `#version 300 es
    precision highp float;
    uniform vec3 tint; out vec4 colour;
    void main() { colour = vec4(tint, 1.0); }`,
};
