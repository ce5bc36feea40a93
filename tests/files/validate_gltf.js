// Usage: node validate_gltf.js MODULE_FOLDER FILE… ; prints one JSON list of reports.
const fs = require("fs");
const path = require("path");
const [folder, ...files] = process.argv.slice(2);
const validator = require(path.join(folder, "node_modules", "gltf-validator"));

async function reportOn(file) {
  const options = { uri: path.basename(file), maxIssues: 50, writeTimestamp: false };
  try {
    return await validator.validateBytes(new Uint8Array(fs.readFileSync(file)), options);
  } catch (problem) {
    return { issues: { numErrors: 1, messages: [String(problem)] } };
  }
}

Promise.all(files.map(reportOn)).then((reports) => console.log(JSON.stringify(reports)));
